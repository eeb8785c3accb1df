# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Parts of a run on a cluster, without a cluster, and what the command line says of wrong options."""

import json
import pickle
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import pytest

from fieldtruth import cli
from fieldtruth.bag.provenance import noted
from fieldtruth.cluster.worker import Recent, difference, facts
from fieldtruth.core.errors import ClusterError, FieldtruthError, UnknownNameError


def test_a_value_is_made_once_while_threads_wait_for_it() -> None:
    recent, gate, made = Recent[str, int](2), threading.Event(), list[str]()

    def make() -> int:
        made.append("a")
        gate.wait(10)
        return 7

    with ThreadPoolExecutor(3) as pool:
        waiting = [pool.submit(recent.get, "a", make) for _ in range(3)]
        gate.set()
        assert [future.result() for future in waiting] == [7, 7, 7]
    assert made == ["a"]


def test_the_values_used_last_are_kept() -> None:
    recent, made = Recent[str, str](2), list[str]()

    def maker(key: str) -> Callable[[], str]:
        def make() -> str:
            made.append(key)
            return key

        return make

    for key in ("a", "b", "a", "c", "a", "b"):
        assert recent.get(key, maker(key)) == key
    assert made == ["a", "b", "c", "b"]


def test_an_error_is_not_kept() -> None:
    recent = Recent[str, int](2)
    with pytest.raises(ZeroDivisionError):
        recent.get("a", lambda: 1 // 0)
    assert recent.get("a", lambda: 1) == 1


def test_a_process_agrees_with_itself_and_not_with_others() -> None:
    here = facts()
    assert difference(facts(), here) == ""
    other = dict(here) | {"numpy": "1.0", "key of the code": "x"}
    assert difference(other, here) == f"numpy 1.0 instead of {here['numpy']}"
    edited = dict(here) | {"key of the code": "x"}
    assert difference(edited, here).startswith("key of the code x instead of ")


def test_a_slice_that_comes_through_the_scheduler_names_what_made_it(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    from fieldtruth.cluster.engine import ClusterSlices
    from fieldtruth.cluster.worker import Order

    order = Order("", "key", str(tmp_path), "token", 0)
    slices = ClusterSlices(MagicMock(), order, MagicMock(), (), 10**9)
    made: Any = SimpleNamespace(status="finished", result=lambda: (b"slice", {"packet width": "8"}))
    assert slices._keep(0, made)
    assert slices.path(0).read_bytes() == b"slice"
    assert json.loads(noted(tmp_path)) == [{"packet width": "8"}]


@pytest.mark.parametrize("error", [UnknownNameError("world", "prak", ["park"]), ClusterError("no scheduler")])
def test_errors_keep_type_and_text_in_another_process(error: FieldtruthError) -> None:
    copy = pickle.loads(pickle.dumps(error))
    assert (type(copy), str(copy)) == (type(error), str(error))


@pytest.fixture
def refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> Callable[[str], str]:
    """Run the command with options, check that it ends with code 2 and one line, writes nothing, and return that."""
    monkeypatch.chdir(tmp_path)

    def run(options: str) -> str:
        before = list(tmp_path.iterdir())
        assert cli.main(["generate", "park_1", *options.split()]) == 2
        assert list(tmp_path.iterdir()) == before
        text = capsys.readouterr().err
        assert text.startswith("error: ")
        assert text.count("\n") == 1
        return text

    return run


def test_a_cluster_is_either_here_or_elsewhere(refused: Callable[[str], str]) -> None:
    assert "give either --scheduler or --local-cluster" in refused("--scheduler tcp://a:1 --local-cluster 2")
    assert "--local-cluster must be an integer of at least 1, got '0'" in refused("--local-cluster 0")


def test_a_scheduler_that_does_not_answer_is_refused(
    refused: Callable[[str], str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("fieldtruth.cluster._PATIENCE_S", 0.5)
    line = "no scheduler answers at tcp://127.0.0.1:9; start one with `dask scheduler`"
    assert line in refused("--scheduler tcp://127.0.0.1:9")
    (tmp_path / "file.json").write_text(json.dumps({"address": "tcp://127.0.0.1:9"}))
    assert line in refused("--scheduler file.json")


def test_a_scheduler_file_must_be_one(refused: Callable[[str], str], tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    assert "no scheduler file nowhere.json, and an address has the form" in refused("--scheduler nowhere.json")
    for text in ("{", "[1]", '{"id": 3}'):
        (tmp_path / "file.json").write_text(text)
        assert "file.json is not a file that `dask scheduler --scheduler-file` wrote" in refused(
            "--scheduler file.json"
        )


def test_dask_is_an_extra(refused: Callable[[str], str], monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith(("distributed", "fieldtruth.cluster.engine"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert "Dask is not installed; run: pip install 'fieldtruth[cluster]'" in refused("--local-cluster 2")
