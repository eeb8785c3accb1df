# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rules of an environment as arithmetic over its fields, written as in a raster calculator: ``0.3 * (slope > 20)``.

A comparison is 1 where it is true and 0 elsewhere; ``and`` is the smaller, ``or`` the larger of two values, ``not`` is
1 minus a value. An expression is parsed, never run as code: names are fields, and functions those of ``FUNCTIONS`` and,
where a whole grid is known or noise may be drawn, those of ``DRAWN``.
"""

import ast
from collections.abc import Callable, Mapping, Sequence, Set
from functools import reduce
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import suggestion

Lookup = Callable[[str], Array]
"""Returns the values of a field by its name."""
Drawn = Mapping[str, Callable[..., Array]]
"""Functions of ``DRAWN`` that are allowed in an expression."""
LONGEST: Final = 600
"""Characters of an expression at most."""


def _smooth(value: Array, low: Array, high: Array) -> Array:
    """Step from 0 at ``low`` to 1 at ``high``, smooth; ``low`` may be the larger one."""
    t = np.clip((value - low) / (high - low), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))


def _rows(x: Array, y: Array, spacing: Array, angle: Array | float = 0.0, offset: Array | float = 0.0) -> Array:
    """Distance [m] to the nearest of parallel lines, ``offset`` [m] to the left, at ``angle`` [deg] to the x axis."""
    across = y * np.cos(np.radians(angle)) - x * np.sin(np.radians(angle)) - offset
    return np.asarray(np.abs((across + spacing / 2) % spacing - spacing / 2))


FUNCTIONS: Final[Mapping[str, tuple[Callable[..., Any], int, int]]] = {
    "abs": (np.abs, 1, 1), "sqrt": (np.sqrt, 1, 1), "exp": (np.exp, 1, 1), "log": (np.log, 1, 1),
    "sin": (np.sin, 1, 1), "cos": (np.cos, 1, 1), "tanh": (np.tanh, 1, 1), "floor": (np.floor, 1, 1),
    "hypot": (np.hypot, 2, 2), "clip": (np.clip, 3, 3), "smooth": (_smooth, 3, 3), "rows": (_rows, 1, 3),
    "min": (lambda *values: reduce(np.minimum, values), 2, 9),
    "max": (lambda *values: reduce(np.maximum, values), 2, 9),
}  # fmt: skip
"""Functions with their least and greatest number of arguments. Angles of sin and cos are in radians."""
DRAWN: Final[Mapping[str, tuple[int, int]]] = {
    "noise": (1, 3), "distance": (1, 1), "blur": (2, 2), "waves": (2, 2),
    "points": (1, 1), "uphill": (2, 2),
}  # fmt: skip
"""Functions that need a whole grid or a seed, with their least and greatest number of arguments: see ``Fields`` and
``Land``."""
_BINARY: Final[Mapping[type, Callable[[Any, Any], Any]]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide, ast.Pow: np.power,
    ast.Mod: np.mod,
}  # fmt: skip
_COMPARED: Final[Mapping[type, Callable[[Any, Any], Any]]] = {
    ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater, ast.GtE: np.greater_equal,
}  # fmt: skip


class Expression:
    """An expression over fields."""

    def __init__(self, text: str | float) -> None:
        """Parse an expression; raises ValueError that says what is wrong with it."""
        self.text = str(text)
        if len(self.text) > LONGEST:
            raise ValueError(f"an expression must have at most {LONGEST} characters, got {len(self.text)}")
        try:
            self._tree = ast.parse(self.text, mode="eval").body
        except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
            raise ValueError(f"not an expression: {self.text!r}") from error
        self.names = {node.id for node in ast.walk(self._tree) if isinstance(node, ast.Name)} - self._calls()
        self.names |= {"x", "y"} if "rows" in self._calls() else set()
        self.drawn = self._calls() & DRAWN.keys()
        """Its functions of ``DRAWN``."""
        _check(self._tree)

    def _calls(self) -> set[str]:
        calls = (node.func for node in ast.walk(self._tree) if isinstance(node, ast.Call))
        return {call.id for call in calls if isinstance(call, ast.Name)}

    def check(self, known: Set[str], drawn: Set[str] = frozenset()) -> None:
        """Check that all its fields are ``known``, and its functions of ``DRAWN`` allowed; raises ValueError."""
        for unknown in sorted(self.names - known):
            raise ValueError(f"unknown field {unknown!r}; {suggestion(unknown, sorted(known))}")
        for name in sorted(self.drawn - drawn):
            allowed = "beyond.fields" if name == "waves" else "fields and relief"
            raise ValueError(f"{name}() is allowed in {allowed} only, got {self.text!r}")

    def values(self, lookup: Lookup, drawn: Drawn = MappingProxyType({})) -> Array:
        """Values where ``lookup`` has those of the fields."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return np.asarray(_value(self._tree, lookup, drawn), np.float64)


class Constant(Expression):
    """An expression over an environment's parameters only."""


def _check(node: ast.AST) -> None:
    """Check that a part is arithmetic; raises ValueError."""
    match node:
        case ast.Constant(value=float() | int() as number) if not isinstance(number, bool):
            return
        case ast.Name():
            return
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
            counts = {**DRAWN, **{known: ends for known, (_, *ends) in FUNCTIONS.items()}}
            if name not in counts:
                raise ValueError(f"unknown function {name!r}; {suggestion(name, counts)}")
            least, most = counts[name]
            if not least <= len(args) <= most:
                raise ValueError(f"{name}() takes {least} to {most} values, got {len(args)}")
            if name in ("noise", "waves"):
                _check_lengths(name, args)
            parts: list[ast.AST] = list(args)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            parts = [left, right]
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() | ast.Not(), operand=operand):
            parts = [operand]
        case ast.BoolOp(values=values):
            parts = list(values)
        case ast.Compare(left=left, ops=ops, comparators=others) if all(type(op) in _COMPARED for op in ops):
            parts = [left, *others]
        case _:
            raise ValueError(f"must be of numbers, fields, + - * / ** %, < > and functions, got {ast.unparse(node)!r}")
    for part in parts:
        _check(part)


def _check_lengths(name: str, args: Sequence[ast.expr]) -> None:
    """Check the values of noise and waves; raises ValueError."""
    given: list[Any] = [each.value if isinstance(each, ast.Constant) else None for each in args]
    numbers = all(isinstance(each, int | float) for each in given)
    text = f"got {name}({', '.join(map(ast.unparse, args))})"
    if name == "waves" and not (numbers and 1 <= given[0] <= given[1]):
        raise ValueError(f"waves() takes a shortest and a longest length from 1 m, {text}")
    wavelength, octaves, gain = given + [5.0, 3, 0.5][len(given) :] if name == "noise" else (5.0, 3, 0.5)
    if not (numbers and wavelength >= 0.1 and gain > 0 and octaves in range(1, 9)):
        raise ValueError(f"noise() takes a wavelength from 0.1 m, 1 to 8 octaves and a gain above 0, {text}")


def _value(node: ast.AST, lookup: Lookup, drawn: Drawn) -> Any:
    """Value of a part that ``_check`` has passed."""

    def value(part: ast.AST) -> Any:
        return _value(part, lookup, drawn)

    match node:
        case ast.Constant(value=number):
            return np.float64(number)  # type: ignore[arg-type]
        case ast.Name(id=name):
            return lookup(name)
        case ast.Call(func=ast.Name(id=name), args=args) if name in DRAWN:
            return drawn[name](*map(value, args))
        case ast.Call(func=ast.Name(id="rows"), args=args):
            return _rows(lookup("x"), lookup("y"), *map(value, args))
        case ast.Call(func=ast.Name(id=name), args=args):
            return FUNCTIONS[name][0](*map(value, args))
        case ast.BinOp(left=left, op=op, right=right):
            return _BINARY[type(op)](value(left), value(right))
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return 1.0 - value(operand)
        case ast.UnaryOp(op=op, operand=operand):
            return -value(operand) if isinstance(op, ast.USub) else value(operand)
        case ast.BoolOp(op=op, values=values):
            return reduce(np.minimum if isinstance(op, ast.And) else np.maximum, map(value, values))
        case ast.Compare(left=left, ops=ops, comparators=others):
            sides = [value(left), *map(value, others)]
            found = [_COMPARED[type(op)](a, b) for op, a, b in zip(ops, sides, sides[1:], strict=False)]
            return np.asarray(reduce(np.logical_and, found), np.float64)
    raise AssertionError(ast.dump(node))
