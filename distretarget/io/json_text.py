"""JSON as text: written with an entry a line, and changed so that all else stays as it is, to the byte."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from distretarget.io.json_node import shared_float

BLANK = re.compile(r"[ \t\n\r]*")
DECODER = json.JSONDecoder(parse_int=shared_float)  # Python refuses to read integers of too many digits


def compact(value: object) -> str:
    """Return a value as JSON without blanks."""
    return json.dumps(value, separators=(",", ":"))


def on_one_line(value: object) -> str:
    """Return a value as JSON on one line; only characters that UTF-8 cannot encode are escaped."""
    return json.dumps(value, ensure_ascii=False).encode("utf-8", "backslashreplace").decode()


def on_lines(value: object, levels: int, indent: str = "") -> str:
    """Return a value as JSON with a line for each entry of the lists and objects in its first levels."""
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
    """A member of an object or list: its key, or its number, and where its value is in the text."""

    key: str | int
    start: int
    end: int


class Edit(NamedTuple):
    """A part of the text to replace."""

    start: int
    end: int
    text: str


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
    """Return the edit that gives the object at a member new values by key, and takes one of its keys away."""
    old = json.loads(text[entry.start : entry.end], parse_int=_number)
    return Edit(entry.start, entry.end, compact({key: old[key] for key in old if key != without} | dict(new)))


def _number(digits: str) -> float:
    """The value of a whole number; a float where Python may refuse to read an integer of so many digits."""
    return int(digits) if len(digits) < 20 else float(digits)


def added(text: str, start: int, entries: Sequence[str]) -> Edit:
    """Return the edit that adds entries, "key":value or values, at the end of the object or list at `start`."""
    start, last = _past_blanks(text, start), None
    for last in members(text, start):  # noqa: B007
        pass
    at = start + 1 if last is None else last.end
    return Edit(at, at, ("," if last and entries else "") + ",".join(entries))


def edited(text: str, edits: Sequence[Edit]) -> str:
    """Return the text with parts replaced that do not overlap."""
    parts, at = [], 0
    for edit in sorted(edits):
        parts += [text[at : edit.start], edit.text]
        at = edit.end
    return "".join([*parts, text[at:]])


def _past_blanks(text: str, start: int) -> int:
    blank = BLANK.match(text, start)
    return blank.end() if blank else start
