# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Images made again in the rebuilt world, and compared pixel by pixel: a sample of the moments, or all of them."""

import threading
from typing import Any, Final, NamedTuple

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from fieldtruth.bag import decode as read
from fieldtruth.bag.reader import RawMessage
from fieldtruth.core.classes import Label
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.experiment.rig import CAMERA_FROM_OPTICAL
from fieldtruth.render.bake import BakedScene
from fieldtruth.render.camera import Camera
from fieldtruth.sense.label_camera import LabelCamera, LabelImages
from fieldtruth.sense.pinhole import pinhole
from fieldtruth.validation.bundle import Bundler, Moment
from fieldtruth.validation.check import Check
from fieldtruth.validation.claims import NOTHING, UNKNOWN, Claim
from fieldtruth.validation.law import Law, check_of
from fieldtruth.validation.sampler import Sampler
from fieldtruth.validation.subject import Examiner, Place, Subject
from fieldtruth.validation.witness import Outcome, Tally, Witness, close

F8 = NDArray[np.float64]

PHOTO_BOUND: Final = 8.0
"""Mean difference [of 255] of a block of 8 x 8 pixels, in which JPEG packs them, to the photograph taken again. On the
same processor there is none; on another, rounding moves single pixels at edges."""
_BLOCK: Final = 8


class Parts(NamedTuple):
    """Pixels of a moment."""

    label: NDArray[np.uint8]
    instance: NDArray[np.uint16] | None
    depth: F8 | None
    photo: NDArray[np.uint8] | None


class Reshoot(Examiner):
    """Images against the rebuilt world."""

    def __init__(self, subject: Subject, place: Place, witness: Witness, sampler: Sampler, *, full: bool) -> None:
        self._subject = subject
        self._place = place
        self._witness = witness
        self._sampler = sampler
        self._full = full
        parts = ("tag", "depth", "instances", *["photograph"] * full)
        self._bundler = Bundler(parts, subject.run.counts, self._ask)
        self.topics = self._bundler.topics
        rule = "the camera, in the world built again, sees the tags, depths and object ids"
        self._tally = Tally(subject, rule, "images")
        self._photo = subject.law("photographs taken again look the same", PHOTO_BOUND, "of 255 in a block of pixels")
        # Where most are equal to the last digit, the processor is the same, and every other one was changed.
        self._equal = Law("photographs taken again are equal to the last digit", 0.0, "of 255", binding=False)
        self._cameras = threading.local()

    def feed(self, raw: RawMessage, message: Any) -> None:
        """See a message."""
        self._bundler.add(raw.topic, raw.stamp_ns, message)

    def finish(self) -> None:
        """See the end of the bag."""
        self._bundler.finish()

    def results(self) -> list[Check]:
        """Retraced images, photographs."""
        tally, part = self._tally, "all" if self._full else "a sample"
        nothing = "no tag images, or no true motion"
        return [
            check_of(
                "retraced images",
                [tally.law, tally.equal],
                f"{tally.law.seen:,} pixels of {tally.count:,} images ({part}) are seen again{tally.pardoned}",
                nothing,
            ),
            check_of("photographs", [self._photo, self._equal],
                     f"{self._photo.seen:,} photographs look the same when taken again: {self._photo.margin}",
                     nothing if self._full else "photographs are taken again for a full validation only"),
        ]  # fmt: skip

    def _ask(self, moment: Moment) -> None:
        if "tag" in moment.parts:
            self._subject.motion.when_known(moment.stamp_ns, lambda: self._ask_posed(moment))

    def _ask_posed(self, moment: Moment) -> None:
        sampled = self._sampler.takes(moment.stamp_ns)
        if not (sampled or self._full):
            return
        cameras, state = self._subject.rig.cameras, self._subject.motion.state(moment.stamp_ns)
        mount = cameras.left if moment.side == "left" else cameras.right
        pose = state.world_from_base @ (mount.base_from_sensor @ CAMERA_FROM_OPTICAL)
        seed = moment.stamp_ns if sampled else None
        self._subject.submit(lambda: self._shoot(moment, pose, seed), self._fold)

    def _fold(self, found: tuple[Outcome, float | None, str] | None) -> None:
        if found is None:
            return
        outcome, photo, place = found
        self._tally.add(outcome, place)
        self._witness.fold(outcome)
        if photo is not None:
            self._photo.measure(photo, place)
            self._equal.measure(photo, place)

    def _shoot(self, moment: Moment, pose: F8, seed: int | None) -> tuple[Outcome, float | None, str] | None:
        config, lens = self._subject.rig.cameras, pinhole(self._subject.rig.cameras)
        told = _parts(moment, (config.height, config.width))
        if told is None:
            return None
        if told.photo is None or self._place.baked is None:
            seen, photo = self._label_camera().label(pose), None
        else:
            picture = self._camera(self._place.baked).render(pose)
            seen, photo = picture, _difference(told.photo, picture.photo, config.jpeg_quality)

        def claim(k: int) -> Claim:
            v, u = divmod(k, config.width)
            ray = np.array([(u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, 1.0])
            length = float(np.linalg.norm(ray))
            reach = float("nan") if told.depth is None else float(told.depth[v, u]) * length
            return Claim(
                where=f"{moment.place('tag')}, row {v}, column {u}",
                origin=pose[:3, 3],
                direction=pose[:3, :3] @ ray / length,
                range_m=NOTHING if told.label[v, u] == Label.SKY else reach,
                label=int(told.label[v, u]),
                instance=UNKNOWN if told.instance is None else int(told.instance[v, u]),
                least=0.0,
                most=config.far,
                pulse=False,
            )

        same, equal = _same(told, seen)
        outcome = self._witness.judge(np.flatnonzero(~same), told.label.size, claim, seed, equal=equal)
        return outcome, photo, moment.place("photograph")

    def _label_camera(self) -> LabelCamera:
        """Return this thread's camera for labels."""
        if not hasattr(self._cameras, "labels"):
            self._cameras.labels = LabelCamera(self._subject.rig.cameras, self._place.scene, reuse=True)
        camera: LabelCamera = self._cameras.labels
        return camera

    def _camera(self, baked: BakedScene) -> Camera:
        """Return this thread's camera for photographs."""
        if not hasattr(self._cameras, "photographs"):
            self._cameras.photographs = Camera(self._subject.rig.cameras, baked, reuse=True)
        camera: Camera = self._cameras.photographs
        return camera


def _parts(moment: Moment, shape: tuple[int, int]) -> Parts | None:
    """Decode a moment; None if something is wrong with a part's form, which is told by its own law."""
    parts = moment.parts
    try:
        with np.errstate(invalid="ignore"):
            found = Parts(
                read.labels(read.image(parts["tag"])),
                read.instances(parts["instances"]) if "instances" in parts else None,
                read.depth(parts["depth"]).astype(np.float64) if "depth" in parts else None,
                read.image(parts["photograph"]) if "photograph" in parts else None,
            )
    except (FieldtruthError, ValueError):
        return None
    return found if all(part is None or part.shape[:2] == shape for part in found) else None


def _same(told: Parts, seen: LabelImages) -> tuple[NDArray[np.bool_], bool]:
    """Which pixels are the same, and whether all of them are to the last digit."""
    same = told.label == seen.label
    if told.instance is not None:
        same &= told.instance == seen.instance
    equal = bool(same.all())
    if told.depth is not None:
        depth = np.where(seen.depth > 0, seen.depth, np.inf).astype(np.float64)
        equal = equal and np.array_equal(told.depth, depth)
        with np.errstate(invalid="ignore"):
            same &= np.where(seen.depth > 0, close(told.depth, depth), told.depth == np.inf)
    return np.asarray(same), equal


def _difference(told: NDArray[np.uint8], mine: NDArray[np.uint8], quality: int) -> float:
    """Largest mean difference of a block of two photographs (h, w, 3), the second one packed as the first was."""
    packed = simplejpeg.encode_jpeg(np.ascontiguousarray(mine), quality, "RGB", "420")
    apart = np.abs(told.astype(np.int16) - simplejpeg.decode_jpeg(packed, "RGB")).mean(axis=2)
    rows, columns = (length // _BLOCK for length in apart.shape)
    blocks = apart[: rows * _BLOCK, : columns * _BLOCK].reshape(rows, _BLOCK, columns, _BLOCK)
    return float(blocks.mean(axis=(1, 3)).max(initial=0.0))
