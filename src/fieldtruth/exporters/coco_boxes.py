# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Further keys of COCO's annotations: boxes of whole objects in the image and in space, and how much is visible."""

import threading
from collections.abc import Sequence
from typing import Any

import numpy as np

from fieldtruth.bag.run import Run
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import CLASSES
from fieldtruth.core.readings import Image
from fieldtruth.exporters.amodal import WholeObjects, world_of_run
from fieldtruth.exporters.coco_segments import Segment, object_bits
from fieldtruth.ontology.label_map import LabelMap
from fieldtruth.world.boxes import named_objects, object_box


class CocoBoxes:
    """Boxes of the segments that are a single object, or its part of one class; may be used by several threads.

    Raises:
        BagError: the world of the run is not known.
    """

    def __init__(self, run: Run, label_map: LabelMap | None, names: Sequence[str]) -> None:
        self._world, self._bits = world_of_run(run), object_bits(names)
        self._configs = {view.label: view.config for view in run.of(Image, recorded=False)}
        self._ids = np.arange(len(CLASSES)) if label_map is None else label_map.ids
        self._boxes = {number: object_box(self._world, each) for number, each in named_objects(self._world).items()}
        self._own = threading.local()

    def objects(self) -> dict[int, dict[str, Any]]:
        """Boxes in the world frame by instance id."""
        return {number: {"box_3d": box.as_json()} for number, box in self._boxes.items()}

    def of(self, camera: str, segments: Sequence[Segment], world_from_optical: Array) -> dict[int, dict[str, Any]]:
        """Keys by id of the segment, for an image of a camera's view from a pose (4, 4)."""
        whole, found, optical_from_world = self._whole(camera), {}, transforms.inverse(world_from_optical)
        for segment in segments:
            category, number = divmod(segment.id, 1 << self._bits)
            if number not in self._boxes:
                continue
            labels = frozenset(int(label) for label in np.flatnonzero(self._ids == category))
            alone = whole.silhouette(number, world_from_optical, labels)
            keys: dict[str, Any] = {
                "amodal_bbox": alone.bbox,
                "amodal_area": alone.pixels,
                "visibility": round(segment.area / max(alone.pixels, segment.area), 6),
            }
            if self._configs[camera].lens.model == "pinhole":
                bounds = whole.bounds(number, world_from_optical, labels)
                if bounds is not None:  # from pixel centres to COCO's pixel borders
                    left, top, right, bottom = (bounds + 0.5).tolist()
                    keys["amodal_bbox_full"] = [left, top, right - left, bottom - top]
            found[segment.id] = keys | {"box_3d": self._boxes[number].in_frame(optical_from_world).as_json()}
        return found

    def _whole(self, camera: str) -> WholeObjects:
        own = vars(self._own)
        if camera not in own:
            own[camera] = WholeObjects(self._world, self._configs[camera])
        whole: WholeObjects = own[camera]
        return whole
