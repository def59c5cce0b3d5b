"""Contact files: JSON that lists which contacts of a clip to keep, drop, add or change, and which were detected."""

from __future__ import annotations

from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

from distretarget.contact_entries import Contact, ContactList, Distance, Entry, Look, Plant
from distretarget.errors import SettingsError, SkeletonFileError, closest
from distretarget.io.files import read_text
from distretarget.io.json_node import Node, on_lines, on_one_line, parse_json

HEADER: dict[str, object] = {"format": "distretarget-contacts", "version": 1}
SUFFIX = ".contacts.json"  # replaces the clip's own in the name of a contact file beside it
KINDS: dict[str, type[Entry]] = {"between": Contact, "plant": Plant, "distance": Distance, "look": Look}
COMMON_KEYS = ("frames", "seconds", "found")  # of all kinds of entries


def load_contacts(path: str | Path) -> ContactList:
    """Return the entries of a contact file; a FileError or SkeletonFileError if it cannot be read or is not valid."""
    return parse_contacts(read_text(path), path)


def parse_contacts(text: str, path: str | Path) -> ContactList:
    """Return the entries in the text of a contact file; `path` is for errors."""
    root = parse_json(path, text)
    entries = root.fields((*HEADER, "contacts"))["contacts"]
    root.check_header(**HEADER)
    return ContactList(tuple(_entry(node) for node in entries.items()), Path(path))


def contacts_to_json(contacts: ContactList) -> str:
    """Return the text of a contact file, one entry per line."""
    return f"{on_lines(HEADER | {'contacts': [_plain(entry) for entry in contacts]}, 2)}\n"


def entry_to_json(entry: Entry) -> str:
    """Return the text of an entry, on one line."""
    return on_one_line(_plain(entry))


def _plain(entry: Entry) -> dict[str, Any]:
    """An entry as JSON values, without defaults."""
    defaults = {each.name: each.default for each in fields(entry)} | {"like": None}
    defaults |= {} if entry.has_effect else {"keep": None}
    values = ((key, getattr(entry, key)) for key in _keys(type(entry)))
    return {key: _whole(value) for key, value in values if value is not None and value != defaults[key]}


def _whole(value: Any) -> Any:
    """A float without a fraction as an int, a tuple as a list."""
    if isinstance(value, tuple):
        return [_whole(each) for each in value]
    return int(value) if isinstance(value, float) and value == int(value) else value


def _keys(kind: type[Entry]) -> list[str]:
    """The keys of a kind of entry, its own before the common ones."""
    return [each.name for each in fields(kind) if each.name not in (*COMMON_KEYS, "place")] + [*COMMON_KEYS]


def _value(node: Node) -> Any:
    """The value at a key, lists as tuples; the entry's class checks it."""
    return tuple(map(_value, node.items())) if isinstance(node.value, list) else node.value


def _entry(node: Node) -> Entry:
    found = node.entries()
    kinds = [key for key in KINDS if key in found]
    if len(kinds) != 1:
        known = {key for kind in KINDS.values() for key in _keys(kind)}
        near = next((key for key in found if key not in known), "")
        advice = f"; {near!r} is no key: {closest(near, tuple(KINDS))}" if near and not kinds else ""
        says = " and ".join(f'"{key}"' for key in kinds) if kinds else "none of them"
        node.fail(f'expected one of "between", "plant", "distance" and "look", found {says}{advice}')
    kind = KINDS[kinds[0]]
    required = [each.name for each in fields(kind) if each.default is MISSING]
    values = node.fields(required, [key for key in _keys(kind) if key not in required])
    if kind in (Contact, Plant) and values.keys().isdisjoint(("keep", "gap", "firmness", "on")):
        says = '"keep" or "gap"' if kind is Contact else '"on" or "keep"'
        node.fail(f"says nothing; expected {says}")
    try:
        return kind(**{key: _value(each) for key, each in values.items()}, place=node.place)
    except SettingsError as error:
        raise SkeletonFileError(node.path, node.place, error.reason) from None
