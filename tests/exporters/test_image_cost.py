# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What the map says of pixels: of points in closed form, and of the classes in the images of a run."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from export_bags import without
from PIL import Image
from sense_worlds import at, box, make_world
from tiny_runs import TinyRun, cloud, straight

from fieldtruth import cli, local_maps
from fieldtruth.bag.reader import open_bag
from fieldtruth.bag.run import open_run
from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.exporters import MapOptions, export
from fieldtruth.exporters.image_cost import pixel_values
from fieldtruth.local_maps import LocalMaps


def test_a_pixel_has_the_value_of_the_cell_below_its_point(monkeypatch: pytest.MonkeyPatch) -> None:
    world = make_world([(box("post", (0.09, 0.09, 2.0), "wood"), at(5.0, 0.0, 2.0))], height=0.3)
    monkeypatch.setattr(local_maps, "world_of_run", lambda run: world)
    run = TinyRun(straight(1.0, 1.0), {"scan": [cloud(0, [])]}, {"scan": np.eye(4)})
    maps = LocalMaps(run, layers=["free", "ground", "slope"], workers=1)
    points: Any = [[5.0, 0.0, 1.0], [5.0, 0.0, 2.4], [2.0, 0.0, 0.3], [2.0, 0.0, 2.2], [np.nan] * 3, [99.0, 0.0, 0.3]]
    xyz = np.array(points).reshape(2, 3, 3)
    assert pixel_values(maps, "free", xyz).tolist() == [[0, 255, 1], [1, 255, 255]]
    np.testing.assert_allclose(pixel_values(maps, "ground", xyz), np.array([[0.3, np.nan, 0.3], [0.3, np.nan, np.nan]]))


@pytest.mark.usefixtures("in_park")
def test_trails_of_a_run_are_free_and_trunks_are_not(brief_run: Path, tmp_path: Path) -> None:
    options = MapOptions(resolution=0.2, layers=["free", "slope"])
    made = export(brief_run, "image-cost", out=tmp_path / "e", workers=2, maps=options)
    run, counted = open_run(brief_run), dict[str, list[Any]]()
    images = run["stereo/left"]
    assert len([*(made / "left/free").iterdir()]) == len([*(made / "right/slope").iterdir()]) == len(images)
    for path in sorted((made / "left/free").iterdir())[::4]:
        free, image = np.asarray(Image.open(path)), images.at(int(path.stem))
        assert (free[image.label == Label.SKY] == 255).all()
        for label in (Label.TRAIL, Label.TRUNK, Label.LAMP_POST):
            counted.setdefault(label.name, []).extend(free[(image.label == label) & (free < 255)].tolist())
        slope = np.load(made / "left/slope" / f"{path.stem}.npy")
        assert (np.isfinite(slope) == (free < 255)).all()
    assert np.mean(counted["TRAIL"]) > 0.98
    assert np.mean(counted["TRUNK"]) < 0.1
    with pytest.raises(ConfigurationError, match="layer seen changes with time"):
        export(brief_run, "image-cost", out=tmp_path / "f", maps=MapOptions(layers=["seen"]))


@pytest.mark.parametrize("to", ["image-cost", "experience"])
def test_without_depth_a_line_says_what_records_it(
    to: str, brief_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with open_bag(brief_run / "park_1.bag") as stored:
        depth = [topic for topic in stored.counts if "depth" in topic]
    assert len(depth) == 2
    bag = without(brief_run / "park_1.bag", tmp_path / "park_1.bag", *depth)
    (tmp_path / "experiment.yaml").write_bytes((brief_run / "experiment.yaml").read_bytes())
    assert cli.main(["export", str(bag), "--to", to]) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert said == f"error: {to} needs images with depth, and {bag} has none; `--extras depth` records it"
    assert not (tmp_path / f"park_1_{to.replace('-', '_')}").exists()
