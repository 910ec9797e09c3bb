"""Dataclasses from the JSON values that `dataclasses.asdict` makes of them."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from enum import Enum
from types import UnionType
from typing import Any, TypeVar, cast, get_args, get_origin, get_type_hints

T = TypeVar("T")


def from_json(kind: type[T], value: Any) -> T:
    """The value of a type, from what JSON has of it.

    Args:
        kind: a dataclass, an enumeration of texts, `list[…]`, `dict[str, …]`, a union with None, or a type of JSON.

    Raises:
        TypeError, ValueError: the value is none of that type.
    """
    return cast(T, _read(kind, value))


def _read(kind: Any, value: Any) -> Any:
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is UnionType:
        return None if value is None else _read(next(each for each in arguments if each is not type(None)), value)
    if is_dataclass(kind) and isinstance(kind, type):
        hints = get_type_hints(kind)
        given = _expect(dict, value)
        known = {field.name for field in fields(kind)}
        return kind(**{name: _read(hints[name], each) if name in known else each for name, each in given.items()})
    if origin is list:
        return [_read(arguments[0], each) for each in _expect(list, value)]
    if origin is dict:
        return {name: _read(arguments[1], each) for name, each in _expect(dict, value).items()}
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind(value)
    return float(_expect(int | float, value)) if kind is float else _expect(kind, value)


def _expect(kind: Any, value: Any) -> Any:
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise TypeError(f"{getattr(kind, '__name__', kind)} is expected, not {value!r}")
    return value
