"""Changes in the text of a JSON document that leave all else as it is, to the byte."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from distretarget.io.json_node import shared_float

BLANK = re.compile(r"[ \t\n\r]*")
DECODER = json.JSONDecoder(parse_int=shared_float)  # Python refuses to read integers of too many digits


class Member(NamedTuple):
    """A member of an object or list: its key, or its number, and where key and value are in the text."""

    key: str | int
    start: int  # of the key; of the value in a list
    value: int
    end: int


class Edit(NamedTuple):
    """A part of the text to replace."""

    start: int
    end: int
    text: str


def compact(value: object) -> str:
    """Return a value as JSON without blanks."""
    return json.dumps(value, separators=(",", ":"))


def members(text: str, start: int) -> Iterator[Member]:
    """Yield the members of the object or list that begins at or after `start` in a valid JSON text."""
    start = _past_blanks(text, start)
    is_object = text[start] == "{"
    at, number = _past_blanks(text, start + 1), 0
    while text[at] not in "}]":
        first, key = at, number
        if is_object:
            key, at = DECODER.raw_decode(text, at)
            at = _past_blanks(text, _past_blanks(text, at) + 1)  # the colon
        value = at
        _, at = DECODER.raw_decode(text, at)
        yield Member(key, first, value, at)
        at, number = _past_blanks(text, at), number + 1
        if text[at] == ",":
            at = _past_blanks(text, at + 1)


def changed(text: str, entry: Member, new: Mapping[str, object], without: str = "") -> Edit:
    """Return the edit that gives the object at a member new values by key, and takes one of its keys away."""
    old = json.loads(text[entry.value : entry.end], parse_int=_number)
    return Edit(entry.value, entry.end, compact({key: old[key] for key in old if key != without} | dict(new)))


def _number(digits: str) -> float:
    """The value of a whole number; a float where Python may refuse to read an integer of so many digits."""
    return int(digits) if len(digits) < 20 else float(digits)


def added(text: str, start: int, entries: Sequence[str]) -> Edit:
    """Return the edit that adds entries, "key":value or values, at the end of the object or list at `start`."""
    start = _past_blanks(text, start)
    last = None
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
