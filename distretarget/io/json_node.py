"""JSON values with their place in the file, for errors; and edits of JSON text that leave the rest of it unchanged."""

from __future__ import annotations

import gc
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple, NoReturn, TypeVar

from distretarget.errors import SkeletonFileError, closest, cut, entry_place, quoted
from distretarget.io.bvh import is_name
from distretarget.skeleton import LARGEST, SMALLEST

Value = TypeVar("Value")

MOST_ENTRIES = 65536  # of a list or object
LARGEST_WHOLE = 2**53  # floats hold all whole numbers up to it
INVALID_SURROGATES = re.compile(r"[\ud800-\udc7f\udd00-\udfff]")  # the others stand for bytes that are not valid UTF-8
BLANK = re.compile(r"[ \t\n\r]*")


@contextmanager
def without_garbage_collection() -> Iterator[None]:
    """Suspend garbage collection, which else takes most of the time of reading large JSON."""
    was_collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_collecting:
            gc.enable()


def parse_json(path: str | Path, text: str) -> Node:
    """Return the JSON value in a text. Numbers become floats: Python refuses integers of too many digits."""
    try:
        with without_garbage_collection():
            return Node(path, "", json.loads(text, object_pairs_hook=tuple, parse_int=shared_float))
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise SkeletonFileError(path, place, f"is not valid JSON: {error.msg}") from None
    except RecursionError:
        raise SkeletonFileError(path, "", "is nested too deeply") from None


@lru_cache(maxsize=65536)
def shared_float(digits: str) -> float:
    """Return the value of a whole number, one float object for equal ones, to save memory."""
    return float(digits)


@dataclass(frozen=True, slots=True)
class Node:
    """A JSON value and its place in the file; objects are tuples of (key, value), lists are lists."""

    path: str | Path
    place: str
    value: object

    def fail(self, reason: str) -> NoReturn:
        """Raise a SkeletonFileError that names this place."""
        raise SkeletonFileError(self.path, self.place, reason)

    def expected(self, what: str) -> NoReturn:
        """Raise a SkeletonFileError that says what was expected at this place, and what was found."""
        self.fail(f"expected {what}, found {described(self.value)}")

    def entries(self, place_of: Callable[[str, str], str] | None = None) -> Fields:
        """Return the values of an object by key, each with its place, by default that of a key of the format."""
        self._check_length(entries := self._of(tuple, "an object"))
        fields = Fields(self)
        for key, value in entries:
            if place_of:
                place = place_of(self.place, key)
            else:
                is_plain = key.isidentifier() and cut(key) == key
                place = f"{self.place}.{key}".lstrip(".") if is_plain else entry_place(self.place, key)
            node = Node(self.path, place, value)
            if key in fields:
                node.fail("expected each key once, found it twice")
            fields[key] = node
        return fields

    def fields(self, required: Sequence[str], optional: Sequence[str] = ()) -> Fields:
        """Return the values of an object by key; all other keys are errors."""
        fields = self.entries()
        for key, node in fields.items():
            if key not in (*required, *optional):
                node.fail(f"unknown key; {closest(key, (*required, *optional))}")
        for key in required:
            if key not in fields:
                self.fail(f'has no "{key}"; expected {quoted(required)}')
        return fields

    def check_header(self, **header: object) -> None:
        """Check that an object has these values at these keys, such as its format and version."""
        fields = self.entries()
        for key, known in header.items():
            if key not in fields:
                self.fail(f'has no "{key}"; expected "{key}": {json.dumps(known)}')
            if isinstance(fields[key].value, bool) or fields[key].value != known:
                fields[key].expected(json.dumps(known))

    def items(self) -> list[Node]:
        """Return the values of a list."""
        self._check_length(entries := self._of(list, "a list"))
        return [Node(self.path, f"{self.place}[{i}]", value) for i, value in enumerate(entries)]

    def numbers(self, count: int) -> list[float]:
        """Return the numbers of a list, which must have `count` of them."""
        if len(numbers := self.items()) != count:
            self.expected(f"a list of {count} numbers")
        return [number.number() for number in numbers]

    def _check_length(self, entries: Sequence[object]) -> None:
        if len(entries) > MOST_ENTRIES:
            self.fail(f"expected at most {MOST_ENTRIES} entries, found {len(entries)}")

    def _of(self, kind: type[Value], what: str) -> Value:
        if not isinstance(self.value, kind):
            self.expected(what)
        return self.value

    def text(self) -> str:
        return self._of(str, "a string")

    def text_or_null(self) -> str | None:
        return None if self.value is None else self._of(str, "a string or null")

    def name(self) -> str:
        """Return a string that can be a joint's name in a BVH file."""
        name = self.text()
        if not is_name(name) or INVALID_SURROGATES.search(name):
            self.expected("a name without braces, line breaks and blanks at its ends")
        return name

    def one_of(self, choices: Sequence[str]) -> str:
        if self.text() not in choices:
            self.expected(f"one of {quoted(choices)}")
        return self.text()

    def number(self) -> float:
        if not abs(value := self._of(float, "a number")) <= LARGEST:
            self.expected(f"a finite number, at most {LARGEST:g}")
        return value

    def positive(self) -> float:
        if not self.number() >= SMALLEST:
            self.expected(f"a number above 0, at least {SMALLEST:g}")
        return self.number()

    def whole(self) -> int:
        return self.index(LARGEST_WHOLE, "")

    def index(self, most: int, key: str) -> int:
        """Return the index of an entry of the list at a key, from 0 to `most`."""
        if most < 0:
            self.fail(f"there are no {key} in the file; export it again")
        if not isinstance(self.value, float) or not 0 <= self.value <= most or self.value != int(self.value):
            self.expected(f"an index of {key}, from 0 to {most}" if key else "a whole number, from 0")
        return int(self.value)

    def flag(self) -> bool:
        return self._of(bool, "true or false")


class Fields(dict[str, Node]):
    """The values of a JSON object by key; `node` is the object, or if it is missing the one that should hold it."""

    def __init__(self, node: Node) -> None:
        self.node = node

    def need(self, key: str) -> Node:
        """Return the value at a key; a SkeletonFileError if the object lacks the key."""
        if key not in self:
            self.node.fail(f'has no "{key}"')
        return self[key]

    def read(self, key: str, read: Callable[[Node], Value], default: Value) -> Value:
        """Return `read` of the value at a key, or the default if the object lacks the key."""
        return read(self[key]) if key in self else default

    def inner(self, key: str) -> Fields:
        """Return the values of the object at a key; empty if this object lacks the key."""
        return self[key].entries() if key in self else Fields(self.node)

    def listed(self, key: str) -> list[Node]:
        """Return the values of the list at a key; empty if this object lacks the key."""
        return self[key].items() if key in self else []


def described(value: object) -> str:
    """Return a short description of a value for messages."""
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}" if isinstance(value, list) else "an object"
    if isinstance(value, str):
        return repr(value if len(value) <= 40 else f"{value[:37]}...")
    return f"{value:.12g}" if isinstance(value, float) else json.dumps(value)


DECODER = json.JSONDecoder(parse_int=shared_float)  # Python refuses to read integers of too many digits


def compact(value: object) -> str:
    """Return a value as JSON without blanks."""
    return json.dumps(value, separators=(",", ":"))


def on_one_line(value: object) -> str:
    """Return a value as JSON on one line; only characters that UTF-8 cannot encode are escaped."""
    return json.dumps(value, ensure_ascii=False).encode("utf-8", "backslashreplace").decode()


def on_lines(value: object, levels: int, indent: str = "") -> str:
    """Return a value as JSON, with a line for each entry of lists and objects down to a depth of `levels`."""
    if not levels or not value or not isinstance(value, list | dict):
        return on_one_line(value)
    inner = f"{indent}  "
    opening, closing = "[]" if isinstance(value, list) else "{}"
    if isinstance(value, dict):
        entries = [f"{on_one_line(key)}: {on_lines(each, levels - 1, inner)}" for key, each in value.items()]
    else:
        entries = [on_lines(each, levels - 1, inner) for each in value]
    lines = ",\n".join(inner + entry for entry in entries)
    return f"{opening}\n{lines}\n{indent}{closing}"


class Member(NamedTuple):
    """A member of an object or list: its key or index, and where its value begins and ends in the text."""

    key: str | int
    start: int
    end: int


Edit = tuple[int, int, str]
"""Where a part of a text begins and ends, and what replaces it."""


def members(text: str, start: int) -> Iterator[Member]:
    """Yield the members of the object or list that begins at or after `start` in a valid JSON text."""
    start = _past_blanks(text, start)
    at, number = _past_blanks(text, start + 1), 0
    while text[at] not in "}]":
        key: str | int = number
        if text[start] == "{":
            key, at = DECODER.raw_decode(text, at)
            at = _past_blanks(text, _past_blanks(text, at) + 1)  # the colon
        _, end = DECODER.raw_decode(text, at)
        yield Member(key, at, end)
        at, number = _past_blanks(text, end), number + 1
        if text[at] == ",":
            at = _past_blanks(text, at + 1)


def changed(text: str, entry: Member, new: Mapping[str, object], without: str = "") -> Edit:
    """Return the edit that sets values by key in the object at a member, and removes the key `without`."""
    old = json.loads(text[entry.start : entry.end], parse_int=_number)
    return entry.start, entry.end, compact({key: old[key] for key in old if key != without} | dict(new))


def _number(digits: str) -> float:
    """The value of a whole number; a float if it is long: Python refuses to read integers of too many digits."""
    return int(digits) if len(digits) < 20 else float(digits)


def added(text: str, start: int, entries: Sequence[str]) -> Edit:
    """Return the edit that adds entries, "key":value or values, at the end of the object or list at `start`."""
    start = _past_blanks(text, start)
    at = max((each.end for each in members(text, start)), default=start + 1)
    return at, at, ("," if at > start + 1 and entries else "") + ",".join(entries)


def edited(text: str, edits: Sequence[Edit]) -> str:
    """Return the text with edits applied, which must not overlap."""
    parts, at = [], 0
    for start, end, new in sorted(edits):
        parts += [text[at:start], new]
        at = end
    return "".join([*parts, text[at:]])


def _past_blanks(text: str, start: int) -> int:
    blank = BLANK.match(text, start)
    return blank.end() if blank else start
