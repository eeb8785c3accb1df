# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Labels for a bag that was recorded elsewhere: python annotate_bag.py BAG OUT [ENVIRONMENT].

The bag needs true poses (/ground_truth/odom or /gazebo/model_states) from a drive through one of our worlds.
"""

import sys

import fieldtruth as ft


def main(bag: str, out: str, environment: str = "park") -> None:
    """Add labelled clouds and images at the bag's own poses."""
    with ft.show_progress() as progress:
        annotated = ft.annotate(bag, environment, out=out, rig=ft.Rig(), progress=progress)
    before, after = ft.count_messages(bag), ft.count_messages(annotated)
    for topic in sorted(after.keys() - before.keys()):
        print(f"{after[topic]:>6} {topic}")


if __name__ == "__main__":
    main(*sys.argv[1:])
