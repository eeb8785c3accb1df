# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Imports follow the layers of pyproject.toml, and there are no import cycles.

Late imports inside functions and imports for type checkers count as well.
"""

import io
import re
import tokenize
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Final

import grimp
import pytest
from importlinter.cli import EXIT_STATUS_SUCCESS, lint_imports

SOURCE: Final = Path(__file__).parents[1] / "src/fieldtruth"
PACKAGES: Final = {path.relative_to(SOURCE).parts[0] for path in SOURCE.rglob("*.py")}
A_KIND: Final = re.compile(r"(?i:lidar|camera|stereo|gnss|wheel_?odometry)|Imu|(?i:(^|_)imus?(_|$))")

PRESCRIBED: Final = {
    "report/rig/__init__.py": {"T_cam_imu", "timeshift_cam_imu", "camera_model", "imu"},  # Kalibr: keys, and a file
    "report/viewer.py": {"image_from_camera", "camera_xyz"},  # arguments of rerun
    "sense/air.py": {"DUST_LIDAR_RATIO", "SNOW_LIDAR_RATIO", "lidar_noise"},  # as physics calls it, and a kernel
    "sense/lens.py": {"camera_rays"},
    "exporters/amodal.py": {"camera_rays"},
    "exporters/coco.py": {"camera", "camera_matrix", "world_from_camera"},  # keys of our rows in COCO's files
    "datasets/__init__.py": {"camera", "lidar"},  # arguments
    "datasets/items.py": {
        *("camera", "lidar", "LiDAR", "camera_stamp_ns", "lidar_stamp_ns"),
        *("world_from_camera", "world_from_lidar", "base_from_camera", "base_from_lidar"),
    },  # arguments, and keys of samples
    "experiment/image_topics.py": {"camera_info"},  # the topic in which ROS's packages expect a calibration
    "experiment/imaging_config.py": {"camera_info"},
    "gazebo/ros.py": {"camera_info"},
    "learning/config.py": {"lidar", "camera"},  # arguments
    "learning/senses.py": {"lidar", "camera"},  # names of observations
    "live/score.py": {"lidar"},  # name of an observation
    "exporters/stereo_depth.py": {"stereo", "StereoSGBM"},  # a folder of the format, and OpenCV's matcher
}
"""Words by file that a format, a public interface or the name of a kernel prescribes, for sensors of any kind."""


def test_every_import_points_to_a_lower_layer(capsys: pytest.CaptureFixture[str]) -> None:
    status = lint_imports(config_filename=str(SOURCE.parents[1] / "pyproject.toml"), no_cache=True)
    assert status == EXIT_STATUS_SUCCESS, capsys.readouterr().out


def test_no_module_imports_itself_through_others() -> None:
    graph = grimp.build_graph("fieldtruth", cache_dir=None)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        pytest.fail("import cycle: " + " -> ".join(error.args[1]))


def kinds_named(source: str) -> list[str]:
    """Names and words in code that name a kind of sensor; comments and docstrings may explain it."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    words = (t.string.strip("'\"") for t in tokens if t.type in (tokenize.NAME, tokenize.STRING))
    return [word for word in words if word.isidentifier() and A_KIND.search(word)]


def test_kinds_of_sensors_are_recognised_in_code() -> None:
    code = '# a camera\nfrom a.gnss.b import ImuConfig\n"""A LiDAR."""\nif kind == \'stereo\':\n    rig.imu.minimum\n'
    assert kinds_named(code) == ["gnss", "ImuConfig", "stereo", "imu"]


@pytest.mark.parametrize("name", sorted(PACKAGES - {"kernels", "sensors"}))
def test_only_its_own_folder_names_a_kind_of_sensor(name: str) -> None:
    """All packages but the kernels, which are for rays or readings of a kind, serve any kind as they serve our own."""
    path = SOURCE / name
    files = sorted(path.rglob("*.py")) if path.is_dir() else [path]
    found = {file.relative_to(SOURCE).as_posix(): {*kinds_named(file.read_text(encoding="utf-8"))} for file in files}
    prescribed = {file: words for file, words in PRESCRIBED.items() if file.partition("/")[0] == name}
    assert {file: words for file, words in found.items() if words} == prescribed
