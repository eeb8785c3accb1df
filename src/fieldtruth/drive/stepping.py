# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Where MuJoCo has what compiled code reads after a step: ``mj_step``, and contacts and forces in its data.

MuJoCo's bindings come with a description of its structures, from which offsets follow. They are tried on a ball on a
plane. Where they are not as described, robots are stepped from Python: with equal bits, and each step takes half as
long again. An error inside of MuJoCo, such as too little memory for contacts, ends the process with its message, where
a step from Python raises MuJoCo's FatalError.
"""

import ctypes as c
import math
from functools import cache
from pathlib import Path
from typing import Any, Final

import mujoco

from fieldtruth.kernels.addresses import register
from fieldtruth.kernels.stepping import Engine

_BALL: Final = """<mujoco><worldbody><geom type="plane" size="1 1 1"/>
<body pos="0 0 0.09"><freejoint/><geom size="0.1"/></body></worldbody></mujoco>"""
_TYPES: Final = {
    "int": c.c_int,
    "size_t": c.c_size_t,
    "uintptr_t": c.c_size_t,
    "uint64_t": c.c_uint64,
    "mjtNum": c.c_double,
    "mjtSize": c.c_int64,
    "mjtBool": c.c_bool,
    "mjtByte": c.c_uint8,
}


def engine_of(model: Any, data: Any) -> Engine | None:
    """Return what ``make_steps`` needs of MuJoCo's model and data; None if it cannot be known."""
    offsets = _offsets()
    return None if offsets is None else Engine(model._address, data._address, *offsets)


@cache
def _offsets() -> tuple[int, ...] | None:
    """Return the last six of ``Engine``, and register ``mj_step``."""
    try:
        data, contact = _structure("mjData"), _structure("mjContact")
        offsets = (
            *(field.offset for field in (data.ncon, data.contact, data.efc_force)),
            *(c.sizeof(contact), contact.geom1.offset, contact.efc_address.offset),
        )
        [library] = Path(mujoco.__file__).parent.glob("libmujoco.*")
        register("mj_step", c.cast(c.CDLL(str(library)).mj_step, c.c_void_p).value or 0)
        return offsets if _fits(*offsets) else None
    except (ImportError, AttributeError, KeyError, ValueError, OSError):  # another version
        return None


def _structure(name: str) -> Any:
    """Return a structure of MuJoCo by its name."""
    from mujoco.introspect import ast_nodes, structs

    def of(kind: Any) -> Any:
        if isinstance(kind, ast_nodes.ArrayType):
            return of(kind.inner_type) * math.prod(kind.extents)
        if isinstance(kind, ast_nodes.PointerType):
            return c.c_void_p
        return _TYPES[kind.name] if kind.name in _TYPES else _structure(kind.name)

    fields = [(field.name, of(field.type)) for field in structs.STRUCTS[name].fields]
    return type(name, (c.Structure,), {"_fields_": fields})


def _fits(ncon: int, contacts: int, forces: int, size: int, geom: int, row: int) -> bool:
    """Return whether offsets are right for a ball on a plane, whose contact MuJoCo's bindings know, too."""
    model = mujoco.MjModel.from_xml_string(_BALL)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)
    known, start = data.contact, data._address
    first = c.c_void_p.from_address(start + contacts).value or 0
    return bool(
        c.c_int.from_address(start + ncon).value == data.ncon == 1
        and model._address
        and first + geom == known.geom1.ctypes.data
        and first + row == known.efc_address.ctypes.data
        and c.c_void_p.from_address(start + forces).value == data.efc_force.ctypes.data
        and known.geom1.strides == known.efc_address.strides == (size,)
    )
