"""Contact files: JSON that says which contacts of a clip to keep, drop, make or change, and what was found in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, TypeVar

from distretarget.contact_entries import Contact, ContactList, Distance, Entry, Look, Plant
from distretarget.errors import SettingsError, SkeletonFileError, closest
from distretarget.io.files import read_text
from distretarget.io.json_node import Node, on_lines, on_one_line, parse_json

HEADER: dict[str, object] = {"format": "distretarget-contacts", "version": 1}
SUFFIX = ".contacts.json"  # of a file beside a clip, instead of the clip's ending
Value = TypeVar("Value")


def load_contacts(path: str | Path) -> ContactList:
    """Return the entries of a contact file.

    Raises:
        FileError: the file cannot be read.
        SkeletonFileError: it breaks the format.
    """
    return parse_contacts(read_text(path), path)


def parse_contacts(text: str, path: str | Path) -> ContactList:
    """Return the entries in the text of a contact file; `path` is for errors."""
    root = parse_json(path, text)
    entries = root.fields((*HEADER, "contacts"))["contacts"]
    root.check_header(**HEADER)
    return ContactList(tuple(_entry(node) for node in entries.items()), Path(path))


def contacts_to_json(contacts: ContactList) -> str:
    """Return the text of a contact file, with an entry a line."""
    return f"{on_lines(HEADER | {'contacts': [_plain(entry) for entry in contacts]}, 2)}\n"


def entry_to_json(entry: Entry) -> str:
    """Return the text of an entry, on one line."""
    return on_one_line(_plain(entry))


def _plain(entry: Entry) -> dict[str, Any]:
    """What an entry says, without what is usual."""
    usual = {each.name: each.default for each in fields(entry)}
    always = {"like"} if entry.acts else {"like", "keep"}
    values = {key: getattr(entry, key) for key in (*READ[type(entry)], *OF_ALL)}
    return {
        key: [_whole(each) for each in value] if isinstance(value, tuple) else _whole(value)
        for key, value in values.items()
        if value is not None and (key in always or value != usual[key])
    }


def _whole(value: Any) -> Any:
    """A number without a fraction as one."""
    return int(value) if isinstance(value, float) and value == int(value) else value


def _entry(node: Node) -> Entry:
    found = node.entries()
    kinds = [key for key in KINDS if key in found]
    if len(kinds) != 1:
        near = next((key for key in found if key not in ALL_KEYS), "")
        advice = f"; {near!r} is no key: {closest(near, tuple(KINDS))}" if near and not kinds else ""
        says = " and ".join(f'"{key}"' for key in kinds) if kinds else "none of them"
        node.fail(f'expected one of "between", "plant", "distance" and "look", found {says}{advice}')
    kind = KINDS[kinds[0]]
    readers = READ[kind] | OF_ALL
    required = [each.name for each in fields(kind) if each.default is MISSING]
    values = node.fields(required, [key for key in readers if key not in required])
    if kind in (Contact, Plant) and values.keys().isdisjoint(("keep", "gap", "firmness", "on")):
        says = '"keep" or "gap"' if kind is Contact else '"on" or "keep"'
        node.fail(f"says nothing; expected {says}")
    try:
        return kind(**{key: readers[key](each) for key, each in values.items()}, place=node.place)
    except SettingsError as error:
        raise SkeletonFileError(node.path, node.place, error.reason) from None


def _several(node: Node, read: Callable[[Node], Value], count: int, expected: str) -> tuple[Value, ...]:
    """The values of a list of so many; an error says what was expected."""
    values = tuple(map(read, node.items()))
    if len(values) != count:
        node.expected(expected)
    return values


def _names(node: Node) -> tuple[str, ...]:
    names = _several(node, Node.text, 2, 'two names, such as ["left hand", "hips"]')
    if names[0] == names[1]:
        node.fail(f"names {names[0]!r} twice; expected two parts")
    return names


def _span(node: Node) -> tuple[float, ...]:
    span = _several(node, Node.number, 2, "the first and the last of them, such as [81, 170]")
    if not 0 <= span[0] <= span[1]:
        node.fail(f"goes from {span[0]:g} to {span[1]:g}; expected the first, from 0, and then the last")
    return span


def _frames(node: Node) -> tuple[float, ...]:
    for each in node.items():
        if each.number() != int(each.number()):
            each.expected("a whole number, or write seconds")
    return _span(node)


def _gap(node: Node) -> float | str:
    if isinstance(node.value, str):
        return node.text() if node.text() == "source" else node.expected('a number of cm, or "source"')
    return _from_zero(node)


def _from_zero(node: Node) -> float:
    if node.number() < 0:
        node.expected("a number from 0")
    return node.number()


def _share(node: Node) -> float:
    if not 0 <= node.number() <= 1:
        node.expected("a number from 0 to 1")
    return node.number()


def _numbers(node: Node) -> tuple[float, ...]:
    return _several(node, Node.number, 3, "three numbers, x, y and z")


def _on(node: Node) -> object:
    return node.text() if isinstance(node.value, str) else _numbers(node)


def _like(node: Node) -> object:
    if isinstance(node.value, str):
        return node.text() if node.text() == "source" else node.expected('"source" or a direction [x, y, z]')
    if not any(_numbers(node)):
        node.fail("is 0, 0, 0, which is no direction; expected one number that is not 0")
    return _numbers(node)


Read = dict[str, Callable[[Node], Any]]
KINDS: dict[str, type[Entry]] = {"between": Contact, "plant": Plant, "distance": Distance, "look": Look}
READ: dict[type[Entry], Read] = {
    Contact: {"between": _names, "keep": Node.flag, "gap": _gap, "firmness": _share},
    Plant: {"plant": Node.text, "on": _on, "keep": Node.flag},
    Distance: {"distance": _names, "value": _from_zero, "priority": _from_zero},
    Look: {"look": Node.text, "like": _like},
}
OF_ALL: Read = {"frames": _frames, "seconds": _span, "found": Node.text}
ALL_KEYS = {*OF_ALL, *(key for read in READ.values() for key in read)}
