# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Croissant metadata of a data set in Parquet files: files with checksums, record sets, responsible-AI properties.

The vocabularies are Croissant 1.0 and Croissant RAI 1.0 of MLCommons (docs.mlcommons.org/croissant).
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import fieldtruth
from fieldtruth.bag.provenance import sha256_of
from fieldtruth.exporters.frames import SPLITS, Member
from fieldtruth.exporters.huggingface_card import content_of, is_own, title_of
from fieldtruth.exporters.parquet import Column
from fieldtruth.ontology import LabelMap
from fieldtruth.report.card import card_part, collection_of, conditions_of

if TYPE_CHECKING:
    from fieldtruth.exporters.parquet import Table

CROISSANT: Final = "croissant.json"

_PARQUET: Final = "application/x-parquet"
_CC_BY: Final = "https://creativecommons.org/licenses/by/4.0/"
_CITE: Final = (
    "@article{sanchez2022automatically, title={Automatically Annotated Dataset of a Ground Mobile Robot in Natural "
    "Environments via Gazebo Simulations}, author={S{\\'a}nchez, M. and Morales, J. and Mart{\\'i}nez, J. L. and "
    "Fern{\\'a}ndez-Lozano, J. J. and Garc{\\'i}a-Cerezo, A.}, journal={Sensors}, volume={22}, number={15}, "
    "pages={5599}, year={2022}, doi={10.3390/s22155599}}"
)
_TYPES: Final = {
    "image": "sc:ImageObject",
    "string": "sc:Text",
    "float32": "sc:Float",
    "float64": "sc:Float",
}
"""Data type by that of the column; all others are integers."""
_TERMS: Final = (
    *("citeAs", "column", "equivalentProperty", "extract", "field", "fileProperty", "fileObject", "fileSet", "format"),
    *("includes", "isLiveDataset", "jsonPath", "key", "md5", "parentField", "path", "recordSet", "references", "regex"),
    *("repeated", "replace", "samplingRate", "separator", "source", "subField", "transform"),
)
"""Terms of Croissant's vocabulary, which its specification asks to be in the context."""
_CONTEXT: Final[dict[str, Any]] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "dct": "http://purl.org/dc/terms/",
    **{key: f"cr:{key}" for key in _TERMS},
    "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
}
_RAI: Final[dict[str, Any]] = {
    "dataCollectionType": ["Software Collection", "Experiments"],
    "dataCollectionRawData": "ROS 1 bags, which the same software makes again, byte for byte, from the experiments.",
    "dataCollectionMissingData": "Frames without all images of their stamp are left out; nothing else is missing.",
    "dataImputationProtocol": "No value is imputed.",
    "dataPreprocessingProtocol": [
        "Photographs are copied as recorded. Flat colours of tag images become class ids.",
    ],
    "dataManipulationProtocol": "No measurement is changed.",
    "dataAnnotationProtocol": [
        "The class and instance of a pixel or point are those of the surface that its ray hits; labels and "
        "measurements are from the same ray.",
    ],
    "dataAnnotationPlatform": ["fieldtruth"],
    "dataAnnotationAnalysis": ["`fieldtruth validate` renders labels again and compares them with those recorded."],
    "annotationsPerItem": "One class and one instance id per pixel and per point.",
    "annotatorDemographics": ["There are no human annotators."],
    "dataBiases": [
        "Frames of one run are neighbours in time and show the same objects; so splits do not share worlds.",
    ],
    "dataUseCases": [
        "Training and test of semantic segmentation of images and clouds, of depth estimation, odometry and SLAM of "
        "ground robots off road.",
        "Not suited alone as proof that a vehicle is safe: test on real data.",
    ],
    "dataSocialImpact": (
        "Off-road perception serves agriculture, forestry, search and rescue; it may serve weapons, too."
    ),
    "personalSensitiveInformation": ["There are no people and no personal data."],
    "dataReleaseMaintenancePlan": "The data can be made again from their experiments with the version that is stated.",
}


def croissant_text(folder: Path, tables: Sequence["Table"], members: Sequence[Member], labels: LabelMap) -> str:
    """Return the content of croissant.json for the Parquet files in ``folder``.

    Licence and responsible-AI properties are known only if fieldtruth generated all runs.
    """
    distribution: list[dict[str, Any]] = []
    for table in tables:
        paths = [path for written in table.splits.values() for path in written.files]
        distribution += [_file_object(path, folder) for path in paths]
        distribution.append(_file_set(table))
    limits = [" ".join(item.split()) for item in card_part("limits").removeprefix("- ").split("\n- ")]
    own = {"license": _CC_BY, "citeAs": _CITE} | _responsible(members, limits) if is_own(members) else {}
    document = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": ["http://mlcommons.org/croissant/1.0", "http://mlcommons.org/croissant/RAI/1.0"],
        "name": title_of(members),
        "description": (
            f"{content_of(members)} of a ground robot in natural environments, with the class of every "
            f"pixel and point. Written by fieldtruth {fieldtruth.__version__}."
        ),
        "version": "1.0.0",
        "keywords": ["robotics", "lidar", "semantic segmentation", "off-road", "synthetic"],
        **own,
        "creator": {"@type": "sc:Organization", "name": "fieldtruth"},
        "isLiveDataset": False,
        "distribution": distribution,
        "recordSet": [_classes(labels), *map(_record_set, tables)],
    }
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def _responsible(members: Sequence[Member], limits: Sequence[str]) -> dict[str, Any]:
    """Return the responsible-AI properties of runs that fieldtruth generated."""
    made = [member.run.experiment for member in members if member.run.experiment is not None]
    collection = f"Simulated by fieldtruth: {collection_of(made)}; cameras and LiDAR are ray tracers."
    biases = [conditions_of(made), *_RAI["dataBiases"]]
    values = _RAI | {"dataCollection": collection, "dataBiases": biases, "dataLimitations": limits}
    return {f"rai:{key}": value for key, value in values.items()}


def _file_object(path: Path, folder: Path) -> dict[str, Any]:
    name = path.relative_to(folder).as_posix()
    return {
        "@type": "cr:FileObject",
        "@id": name,
        "name": name,
        "contentUrl": name,
        "contentSize": f"{path.stat().st_size} B",
        "encodingFormat": _PARQUET,
        "sha256": sha256_of(path),
    }


def _file_set(table: "Table") -> dict[str, Any]:
    name = f"{table.name}-files"
    return {
        "@type": "cr:FileSet",
        "@id": name,
        "name": name,
        "description": f"The Parquet files of {table.name}, of all splits.",
        "encodingFormat": _PARQUET,
        "includes": f"{table.name}/*.parquet",
    }


def _classes(labels: LabelMap) -> dict[str, Any]:
    """The record set of the classes, whose records are in the metadata."""
    rows = [
        {"classes/id": number, "classes/name": name, "classes/rgb": " ".join(map(str, rgb))}
        for number, (name, rgb) in sorted(labels.classes.items())
    ]
    fields = [("id", "sc:Integer"), ("name", "sc:Text"), ("rgb", "sc:Text")]
    return {
        "@type": "cr:RecordSet",
        "@id": "classes",
        "name": "classes",
        "description": f"Id, name and colour of each class of {labels.name}.",
        "dataType": "sc:Enumeration",
        "key": {"@id": "classes/id"},
        "field": [
            {"@type": "cr:Field", "@id": f"classes/{name}", "name": name, "dataType": kind} for name, kind in fields
        ],
        "data": rows,
    }


def _record_set(table: "Table") -> dict[str, Any]:
    files = {"fileSet": {"@id": f"{table.name}-files"}}
    split = {
        "@type": "cr:Field",
        "@id": f"{table.name}/split",
        "name": "split",
        "description": "train, val or test",
        "dataType": "sc:Text",
        "source": files
        | {"extract": {"fileProperty": "filename"}, "transform": {"regex": f"^({'|'.join(SPLITS)})-.*$"}},
    }
    keys = [column.name for column in table.columns if column.name in ("run", "camera", "lidar", "stamp_ns")]
    return {
        "@type": "cr:RecordSet",
        "@id": table.name,
        "name": table.name,
        "key": [{"@id": f"{table.name}/{name}"} for name in keys],
        "field": [split, *(_field(table.name, column, files) for column in table.columns)],
    }


def _field(name: str, column: Column, files: dict[str, Any]) -> dict[str, Any]:
    source = files | {"extract": {"column": column.name}}
    if column.kind == "image":
        source |= {"transform": {"jsonPath": "bytes"}}
    return {
        "@type": "cr:Field",
        "@id": f"{name}/{column.name}",
        "name": column.name,
        "description": column.about,
        "dataType": _TYPES.get(column.dtype, "sc:Integer"),
        **({"repeated": True} if column.is_list else {}),
        "source": source,
    }
