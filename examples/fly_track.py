# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Fly a helix over the park along a track file, and draw what the camera sees: python fly_track.py [OUT [SECONDS]]."""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fieldtruth as ft

RADIUS, TURN_RATE, CLIMB = 12.0, 0.2, 0.5  # [m], [rad/s], [m/s]
LOOK_DOWN = 45.0  # [deg]; pitch is positive nose down


def write_helix(path: Path, seconds: float) -> None:
    """Write poses at 10 Hz: on a circle around the middle of the world, looking inwards and down."""
    with path.open("w") as file:
        print("t,x,y,z,roll_deg,pitch_deg,yaw_deg", file=file)
        for t in np.arange(0.0, seconds + 0.05, 0.1):
            angle = TURN_RATE * t
            x, y, z = RADIUS * np.cos(angle), RADIUS * np.sin(angle), 14.0 + CLIMB * t
            print(t, x, y, z, 0.0, LOOK_DOWN, np.degrees(angle) + 180.0, sep=",", file=file)


def main(out: str = "data", seconds: str = "10") -> None:
    """Sense along the helix; a path into the ground or a trunk would raise TrackError: when, where, in what."""
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    write_helix(folder / "helix.csv", float(seconds))
    experiment = ft.Experiment(
        name="helix",
        environment="park",
        drive=ft.DriveConfig(track=str(folder / "helix.csv")),
        rig=ft.paper_rig(cameras=ft.StereoConfig(width=640, height=360, rate_hz=5.0)),
    )
    bag = ft.generate(experiment, folder, overwrite=True)

    left = "/stereo/camera/left"
    messages = {reading.topic: reading.message for reading in ft.read_bag(bag)}  # the last of each topic
    images = [ft.bag.image(messages[f"{left}/{kind}"]) for kind in ("real/compressed", "tag/img_raw")]
    figure, axes = plt.subplots(1, 2, figsize=(13, 4), layout="constrained")
    for axis, image in zip(axes, images, strict=True):
        axis.imshow(image)
        axis.set_axis_off()
    figure.savefig(folder / "helix.png")
    height = messages["/ground_truth/odom"].pose.pose.position.z
    points = len(ft.bag.points(messages["/os1_cloud_node/points"]))
    print(f"{ft.open_run(bag).duration_s:.1f} s in {bag}; at the end {height:.1f} m high, {points} points in the scan")


if __name__ == "__main__":
    main(*sys.argv[1:])
