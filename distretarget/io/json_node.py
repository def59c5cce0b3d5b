"""JSON values that know their place in the file, and say what they are and what was expected."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from distretarget.errors import SkeletonFileError, closest, quoted
from distretarget.io.bvh_parser import is_name
from distretarget.skeleton import LARGEST

NO_CHARACTER = re.compile(r"[\ud800-\udc7f\udd00-\udfff]")
"""The surrogates that stand for nothing; the others are bytes that were found to be no UTF-8."""


def parse_json(path: str | Path, text: str) -> object:
    """The JSON in the text, all numbers as floats, so that none is too long for Python's int."""
    try:
        return json.loads(text, object_pairs_hook=tuple, parse_int=float)
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise SkeletonFileError(path, place, f"is no JSON: {error.msg}") from None
    except RecursionError:
        raise SkeletonFileError(path, "", "is nested too deeply; the format has four levels") from None


def entry_place(place: str, key: str) -> str:
    """The place of an entry under a free key, on one line and printable."""
    return f"{place}[{json.dumps(key, ensure_ascii=not key.isprintable())}]"


def field_place(place: str, key: str) -> str:
    """The place of an entry under a key that the format sets."""
    return f"{place}.{key}".lstrip(".") if key.isidentifier() else entry_place(place, key)


@dataclass(frozen=True)
class Node:
    """A JSON value and its place in the file. Objects are tuples of (key, value), lists are lists."""

    path: str | Path
    place: str
    value: object

    def fail(self, reason: str) -> NoReturn:
        raise SkeletonFileError(self.path, self.place, reason)

    def expected(self, what: str) -> NoReturn:
        self.fail(f"expected {what}, found {found(self.value)}")

    def entries(self, place_of: Callable[[str, str], str] = entry_place) -> dict[str, Node]:
        """The values of an object, each under its key and at `place_of(self.place, key)`."""
        if not isinstance(self.value, tuple):
            self.expected("an object")
        nodes: dict[str, Node] = {}
        for key, value in self.value:
            node = Node(self.path, place_of(self.place, key), value)
            if key in nodes:
                node.fail("expected each key once, found it twice")
            nodes[key] = node
        return nodes

    def fields(self, required: Sequence[str], optional: Sequence[str]) -> dict[str, Node]:
        """The values of an object with known keys."""
        fields = self.entries(field_place)
        for key, node in fields.items():
            if key not in (*required, *optional):
                node.fail(f"unknown key; {closest(key, (*required, *optional))}")
        for key in required:
            if key not in fields:
                self.fail(f'has no "{key}"; expected {quoted(required)}')
        return fields

    def items(self) -> list[Node]:
        """The values of a list."""
        if not isinstance(self.value, list):
            self.expected("a list")
        return [Node(self.path, f"{self.place}[{i}]", value) for i, value in enumerate(self.value)]

    def text(self) -> str:
        if not isinstance(self.value, str):
            self.expected("a string")
        return self.value

    def text_or_null(self) -> str | None:
        if self.value is not None and not isinstance(self.value, str):
            self.expected("a string or null")
        return self.value

    def name(self) -> str:
        """A string that a BVH file can hold as a name."""
        name = self.text()
        if not is_name(name) or NO_CHARACTER.search(name):
            self.expected("a name without braces, line breaks and blanks at its ends")
        return name

    def one_of(self, choices: Sequence[str]) -> str:
        if self.text() not in choices:
            self.expected(f"one of {quoted(choices)}")
        return self.text()

    def number(self) -> float:
        if not isinstance(self.value, float):
            self.expected("a number")
        if not abs(self.value) <= LARGEST:
            self.expected(f"a finite number, at most {LARGEST:g}")
        return self.value

    def positive(self) -> float:
        if not self.number() > 0:
            self.expected("a number above 0")
        return self.number()

    def flag(self) -> bool:
        if not isinstance(self.value, bool):
            self.expected("true or false")
        return self.value


def found(value: object) -> str:
    """What a value is, in a few words."""
    match value:
        case tuple():
            return "an object"
        case list():
            return f"a list of {len(value)}"
        case str():
            return repr(value if len(value) <= 40 else f"{value[:37]}...")
        case float():
            return f"{value:.12g}"
        case _:
            return json.dumps(value)
