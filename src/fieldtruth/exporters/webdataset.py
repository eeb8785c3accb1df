# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export runs as WebDataset: numbered tar files per split, which a network reads as a stream while it learns.

The members of a sample have the same name up to the first dot, ``RUN_STAMP``: of each view ``left.jpg`` (or
``left.png``, as recorded), ``left.mask.png``, ``left.npz``, of each sensor of clouds ``cloud.npz`` or
``NAME.cloud.npz``, with options of maps ``local_map.npz``, and ``json``. Depth and instance ids are arrays in ``npz``,
because the library's decoders convert every image to 8 bits. Sensors have different rates, so that some clouds, and
images of a faster camera, are in no frame: files of their own have every cloud of a sensor, and every image of such a
camera.
"""

import io
import json
import tarfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final, NamedTuple
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.provenance import sha256_of
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import Source
from fieldtruth.core.png import encode_png
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.datasets.items import ROLES
from fieldtruth.exporters import Options
from fieldtruth.exporters.frames import PAPER, SPLITS, Frames, Member, count_common, require_frames, views_of
from fieldtruth.exporters.local_maps import local_maps_of
from fieldtruth.exporters.zipped import add_member
from fieldtruth.local_maps import LocalMaps
from fieldtruth.ontology import LabelMap

DATASET: Final = "dataset.json"

_BLOCK: Final = tarfile.BLOCKSIZE
_END: Final = tarfile.RECORDSIZE  # [byte]; at most this is written after the last member


class Sample(NamedTuple):
    """A frame, or a cloud, as the members of a tar file."""

    key: str
    parts: dict[str, bytes]
    """Content by extension."""

    @property
    def size(self) -> int:
        """Bytes in the tar file: a header and whole blocks per member."""
        return sum(_BLOCK + -(-len(data) // _BLOCK) * _BLOCK for data in self.parts.values())


Content = tuple[list[Source], list[Source]]
"""Views and sensors of clouds whose readings some samples of a run have."""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder: shards ``SPLIT-000000.tar`` of frames and ``clouds-SPLIT-000000.tar``, and ``dataset.json``.

    Raises:
        BagError: a run has neither images with labels nor clouds, or is damaged.
    """
    target.mkdir(parents=True)
    labels = options.labels
    contents = {member.name: _contents(member.run) for member in options.members}
    described = {member.name: _run_row(member, contents[member.name]) for member in options.members}
    names = sorted(
        {name for own in contents.values() for name in own}, key=lambda name: (name.startswith("clouds"), name)
    )
    shards: list[dict[str, Any]] = []
    for split in SPLITS:
        prefixes = {name: split if name == "frames" else f"{name}-{split}" for name in names}
        files = {name: _Shards(target, prefixes[name], options.shard_bytes) for name in names}
        with ExitStack() as opened:
            for each in files.values():
                opened.enter_context(each)
            for member in options.members:
                if member.split == split:
                    _write_run(member, contents[member.name], files, described[member.name], options)
        for name, each in files.items():
            shards += [{"url": url, "split": split, "content": name, "samples": n} for url, n in each.samples.items()]
    with options.progress.stage("checksums"):
        for shard in shards:
            path = target / shard["url"]
            shard |= {"bytes": path.stat().st_size, "sha256": sha256_of(path)}
    (target / DATASET).write_text(_text(labels, list(described.values()), shards), encoding="utf-8")


def _write_run(
    member: Member,
    contents: Mapping[str, Content],
    files: Mapping[str, "_Shards"],
    row: dict[str, Any],
    options: Options,
) -> None:
    """Add the samples of a run, whose maps alone are in memory, to the files of its split; count them in its row."""
    maps = local_maps_of(member.run, options)
    for name in files:
        if name in contents:
            frames = Frames(member.run, options.labels, *contents[name])
            row[name] = len(frames)
            for sample in _samples(member, frames, name, options, maps):
                files[name].add(sample)


def _contents(run: Run) -> dict[str, Content]:
    """Contents of a run by name: frames of all views, of a sensor's with images in no such frame, and clouds of each.

    Raises:
        BagError: it has nothing of these.
    """
    require_frames(run, clouds=True)
    devices, clouds = views_of(run), run.of(Cloud)
    found: dict[str, Content] = {}
    if every := [view for views in devices.values() for view in views]:
        common = count_common(run, every) if len(devices) > 1 else -1
        if common:
            found["frames"] = every, clouds
        for name, views in devices.items() if len(devices) > 1 else ():
            if count_common(run, views) > common:
                found[f"frames_{name}"] = views, clouds
    return found | {"clouds" if each.name == PAPER else f"clouds_{each.name}": ([], [each]) for each in clouds}


def _samples(
    member: Member, frames: Frames, content: str, options: Options, maps: LocalMaps | None
) -> Iterator[Sample]:
    """Encode the frames of a run, in time order, all with the same parts: a frame may have an empty cloud."""
    empty = frames.empty_clouds()

    def encode(i: int) -> Sample:
        frame = frames[i]
        parts: dict[str, bytes] = {}
        for name, view in frame.views.items():
            parts |= {f"{name}{view.suffix}": view.photo, f"{name}.mask.png": encode_png(view.mask)}
            if view.extras:
                parts[f"{name}.npz"] = npz(view.extras)
        for name, cloud in (empty | frame.clouds).items():
            parts["cloud.npz" if name == PAPER else f"{name}.cloud.npz"] = npz(cloud)
        if maps is not None:
            parts["local_map.npz"] = npz(maps.at(frame.stamp_ns).arrays)
        about = {"run": member.name, "split": member.split} | frame.about
        parts["json"] = json.dumps(about, separators=(",", ":")).encode()
        return Sample(f"{member.name}_{frame.stamp_ns:019d}", dict(sorted(parts.items())))

    return options.each(f"{member.name}: {content}", member.run, range(len(frames)), encode)


class _Shards(ExitStack):
    """Tar files of a split, each as large as allowed."""

    def __init__(self, folder: Path, split: str, most: int) -> None:
        super().__init__()
        self._folder, self._split, self._most = folder, split, most
        self._tar: tarfile.TarFile | None = None
        self.samples: dict[str, int] = {}
        """Number of samples by file name."""

    def add(self, sample: Sample) -> None:
        """Add a sample to the current file, or to a new one if it is full."""
        if self._tar is None or self._tar.offset + sample.size + _END > self._most:
            self.close()
            name = f"{self._split}-{len(self.samples):06d}.tar"
            self._tar = self.enter_context(tarfile.TarFile(self._folder / name, "w", format=tarfile.USTAR_FORMAT))
            self.samples[name] = 0
        for extension, data in sample.parts.items():
            info = tarfile.TarInfo(f"{sample.key}.{extension}")  # without date and owner: equal runs, equal bytes
            info.size = len(data)
            self._tar.addfile(info, io.BytesIO(data))
        self.samples[next(reversed(self.samples))] += 1


def npz(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Pack arrays as ``numpy.savez_compressed`` does, without dates and with a faster Deflate."""
    stream = io.BytesIO()
    with ZipFile(stream, "w") as archive:
        for name, array in arrays.items():
            packed = io.BytesIO()
            np.save(packed, array, allow_pickle=False)
            add_member(archive, f"{name}.npy", [packed.getvalue()])
    return stream.getvalue()


def _run_row(member: Member, contents: Mapping[str, Content]) -> dict[str, Any]:
    row: dict[str, Any] = {"name": member.name, "split": member.split}
    if (made_by := member.run.experiment) is not None:
        row |= {"environment": made_by.world_name, "seed": made_by.seed}
    labels = [view.label for views in views_of(member.run).values() for view in views]
    clouds = {} if any(name.startswith("clouds_") for name in contents) else {"clouds": 0}
    return row | {f"{ROLES[Image].key}s": labels, "frames": 0} | clouds


def _text(labels: LabelMap, runs: list[dict[str, Any]], shards: list[dict[str, Any]]) -> str:
    """Content of dataset.json, a line per class, run and shard."""
    classes = [{"id": number, "name": name, "rgb": rgb} for number, (name, rgb) in sorted(labels.classes.items())]
    lists = {"classes": classes, "runs": runs, "shards": shards}
    rows = {key: ",\n".join(f"  {json.dumps(row)}" for row in group) for key, group in lists.items()}
    body = "".join(f',\n "{key}": [\n{text}\n ]' for key, text in rows.items())
    return f'{{\n "labels": {json.dumps(labels.name)}{body}\n}}\n'
