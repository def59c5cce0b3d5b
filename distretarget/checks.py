"""Argument checks of public functions, for callers without a type checker; all raise a SettingsError."""

from __future__ import annotations

import os
import reprlib
from collections.abc import Callable, Collection
from dataclasses import fields
from typing import Any

from distretarget.errors import SettingsError


def check_kind(name: str, value: object, *kinds: type) -> None:
    """Check that an argument has one of some types."""
    if not isinstance(value, kinds):
        wanted = " or ".join(kind.__name__ for kind in kinds)
        raise SettingsError(f"{name} is {reprlib.repr(value)}; expected a {wanted}")


def check_path(name: str, value: object) -> None:
    """Check that an argument is the path of a file or folder, as text or a path object."""
    if not isinstance(value, str) and not (isinstance(value, os.PathLike) and isinstance(os.fspath(value), str)):
        raise SettingsError(f"{name} is {reprlib.repr(value)}; expected a path, as str or pathlib.Path")


def check_choice(name: str, value: object, choices: Collection[str | None]) -> None:
    """Check that an argument is one of the choices."""
    if not (value is None or isinstance(value, str)) or value not in choices:
        raise SettingsError(f"{name} is {reprlib.repr(value)}; expected one of {', '.join(map(repr, choices))}")


def check_number(name: str, value: object, least: float, most: float) -> None:
    """Check that an argument is a number within bounds."""
    number: Any = value
    several = getattr(value, "ndim", 0) != 0
    if several or isinstance(value, bool | str) or not hasattr(value, "__float__") or not least <= number <= most:
        raise SettingsError(f"{name} is {reprlib.repr(value)}; expected a number from {least:g} to {most:g}")


def check_callable(name: str, value: object) -> None:
    """Check that an argument can be called."""
    if not isinstance(value, Callable):  # type: ignore[arg-type]
        raise SettingsError(f"{name} is {reprlib.repr(value)}; expected a function")


def brief_repr(settings: Any) -> str:
    """Return the repr of a dataclass with defaults for all fields, showing only fields that differ from them."""
    defaults = type(settings)()
    values = ((field.name, getattr(settings, field.name), getattr(defaults, field.name)) for field in fields(settings))
    given = ", ".join(f"{name}={value!r}" for name, value, default in values if value != default)
    return f"{type(settings).__name__}({given})"
