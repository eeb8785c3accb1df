# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Make a labelled run and open it: python whole_run.py [EXPERIMENT [SECONDS [OUT]]]."""

import sys

import fieldtruth as ft


def main(name: str = "park_1", seconds: str = "5", out: str = "data") -> None:
    """Drive, sense, label, write the bag, check it, and count its messages."""
    experiment = ft.with_overrides(ft.load_experiment(name), seconds=float(seconds))
    with ft.show_progress() as progress:
        bag = ft.generate(experiment, out, progress=progress)

    run = ft.open_run(bag.parent)
    print(f"{run.name}: {run.duration_s:.1f} s in {bag}")
    for topic, count in sorted(ft.count_messages(bag).items()):
        print(f"{count:>7} {topic}")
    failed = [check.name for check in ft.validate(bag.parent) if check.passed is False]
    print("all checks pass" if not failed else f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main(*sys.argv[1:])
