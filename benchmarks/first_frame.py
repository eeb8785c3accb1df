# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Time from a fresh virtual environment to the first labelled photograph, and of a second one.

Run: python benchmarks/first_frame.py. For the second frame, world, light and kernels come from the cache.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

REPOSITORY = Path(__file__).parents[1]
FRAME = """
import fieldtruth as ft
scene = ft.Scene(ft.load_world("park"))
pose = ft.transforms.pose((0, 0, float(scene.world.terrain.field.height_at(0, 0)) + 0.8)) @ ft.OPTICAL
print(ft.Camera(ft.CameraConfig(), ft.bake(scene)).render(pose).label.shape)
"""


def main() -> None:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    with TemporaryDirectory() as folder:
        python = str(Path(folder, "venv", "bin", "python"))
        environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "NUMBA"))}
        environment["XDG_CACHE_HOME"] = str(Path(folder, "cache"))

        def timed(what: str, *command: str, env: dict[str, str]) -> None:
            start = perf_counter()
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL, cwd=folder, env=env)
            print(f"{what:<16}{perf_counter() - start:>7.1f} s", flush=True)

        # pip may use its cache: the time of the network is not measured.
        timed("environment", sys.executable, "-m", "venv", "venv", env=dict(os.environ))
        timed("pip install", python, "-m", "pip", "install", "--quiet", str(REPOSITORY), env=dict(os.environ))
        timed("first frame", python, "-c", FRAME, env=environment)
        timed("second frame", python, "-c", FRAME, env=environment)


if __name__ == "__main__":
    main()
