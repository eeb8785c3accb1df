# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Draw docs/local_maps.jpg and docs/local_maps_pixels.jpg: local_maps_pictures.py RUN IMAGE_COST EXPERIENCE FOLDER."""

import json
import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

import fieldtruth as ft

LAYERS = ("ground", "ground_class", "plant_top", "slope", "seen", "free")


def draw_maps(run: Path, out: Path) -> None:
    """Draw layers of the map in the middle of a run, north up, with its path and the free polygon."""
    maps = ft.LocalMaps(run, layers=LAYERS)
    made = maps[len(maps) // 2]
    pose, side = made.world_from_base, made.grid.shape[0] * made.grid.resolution
    heading = np.arctan2(pose[1, 0], pose[0, 0])
    turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    polygon, path = made.free_polygon @ turn.T + pose[:2, 3], maps.run.trajectory.position
    figure, axes = plt.subplots(1, len(LAYERS), figsize=(18, 3.6))
    for axis, name in zip(axes, LAYERS, strict=True):
        extent = (made.grid.y0, made.grid.y0 + side, made.grid.x0, made.grid.x0 + side)
        axis.imshow(made.layers[name], origin="lower", extent=extent)
        axis.plot(polygon[:, 1], polygon[:, 0], "w", linewidth=1)
        axis.plot(path[:, 1], path[:, 0], "r", linewidth=2)
        axis.set(title=name, xlim=extent[1::-1], ylim=extent[2:], xticks=[], yticks=[])
    figure.tight_layout()
    figure.savefig(out, dpi=80)


def draw_pixels(image_cost: Path, experience: Path, out: Path) -> None:
    """Draw free pixels of an image, and the places that it shows."""
    lines = [json.loads(line) for line in (experience / "frames.jsonl").read_text(encoding="utf-8").splitlines()]
    line = next(each for each in lines if each["sensor"] == "left" and each["stamp_ns"] > 1_000_000_000)
    photo = np.asarray(Image.open(experience / line["photo"]))
    free = np.asarray(Image.open(image_cost / "left" / "free" / f"{line['stamp_ns']}.png"))
    colours = np.zeros((256, 4))
    colours[0], colours[1] = (1, 0, 0, 0.6), (0, 1, 0, 0.3)
    places = np.full(free.shape, np.nan)
    with np.load(experience / line["file"]) as file:
        places[file["pixel"][:, 1], file["pixel"][:, 0]] = file["place"]
    figure, axes = plt.subplots(1, 2, figsize=(18, 5.2))
    for axis, shown in zip(axes, (colours[free], places), strict=True):
        axis.imshow(photo)
        axis.imshow(shown, alpha=None if shown is not places else 0.5, cmap="tab20")
        axis.axis("off")
    axes[1].plot(*np.array(line["pixel"]).T, "k+")
    figure.tight_layout()
    figure.savefig(out, dpi=70)


if __name__ == "__main__":
    run, image_cost, experience, folder = map(Path, sys.argv[1:])
    draw_maps(run, folder / "local_maps.jpg")
    draw_pixels(image_cost, experience, folder / "local_maps_pixels.jpg")
