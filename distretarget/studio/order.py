"""An order, all settings for one clip on one character: from the page or a project file, and as a command line."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import count
from pathlib import Path, PurePath
from typing import Any

from distretarget.contact_entries import NO_CONTACTS, ContactList
from distretarget.errors import FileError, SettingsError
from distretarget.io.contacts_file import contacts_to_json, parse_contacts
from distretarget.io.files import hash_of_file, read_text, safe_file_name
from distretarget.io.input_file import InputFile
from distretarget.io.json_node import on_lines, parse_json
from distretarget.io.map_json import HEADER as MAP_HEADER
from distretarget.io.map_json import parse_map
from distretarget.io.motion_writer import OutputSettings
from distretarget.pipeline.edits import NO_EDITS, Edits
from distretarget.pipeline.options import DEFAULT_OPTIONS, Options
from distretarget.pipeline.retargeting import Recipe

HEADER: dict[str, object] = {"format": "distretarget-project", "version": 1}
FILES = ("clip", "character")
LONGEST = 100  # of the part of an input's name that goes into a result's [bytes]
OF_CLIP = ("animation", "edits", "contacts")  # fields of an order that depend on the clip
SETTINGS = (*OF_CLIP, "fps", "options", "in_place", "map", "rest")  # fields of an order


@dataclass(frozen=True)
class Order:
    """A clip to retarget to a character, and all settings."""

    clip: str  # the id of its file, in a project file the name
    character: str  # the same
    recipe: Recipe
    contacts: ContactList
    format: str | None  # suffix of the output; None for the character's default
    key: str  # the JSON it was made from

    @classmethod
    def of(cls, given: Mapping[str, Any], path: Path | None = None) -> Order:
        """Return the order that the page sent, or that is in the file `path`; errors as in `load_project`."""
        known = {*FILES, *SETTINGS, "format"}
        if not isinstance(given, Mapping) or not given.keys() <= known or not given.keys() >= {*FILES}:
            raise SettingsError(f"an order is {given!r:.80}; expected the fields {', '.join(sorted(known))}")
        entries = given.get("contacts") or []
        text = json.dumps({"format": "distretarget-contacts", "version": 1, "contacts": entries})
        if not all(isinstance(given.get(name), str | None) for name in ("animation", "format")):
            raise SettingsError("the animation and the format of an order are names")
        if not isinstance(given.get("fps"), int | float | None):
            raise SettingsError("the frame rate of an order is a number")
        try:
            edits, options = Edits(**given.get("edits") or {}), Options(**given.get("options") or {})
        except TypeError as error:
            raise SettingsError(f"an order has a setting that is not known: {error}") from None
        return cls(
            clip=str(given["clip"]),
            character=str(given["character"]),
            recipe=Recipe(
                options,
                parse_map(_map_text(given), path or "map.json"),
                given.get("animation"),
                given.get("fps"),
                OutputSettings(in_place=bool(given.get("in_place"))),
                edits=edits,
            ),
            contacts=parse_contacts(text, path or "contacts.json") if entries else NO_CONTACTS,
            format=given.get("format"),
            key=json.dumps(given, sort_keys=True),
        )

    @property
    def preparation(self) -> str:
        """The order without contacts and format, as JSON; orders for which it is equal share a `Conversion`."""
        return json.dumps({**json.loads(self.key), "contacts": None, "format": None}, sort_keys=True)

    @property
    def has_map(self) -> bool:
        """Whether its command line needs a map file."""
        return bool(self.recipe.map_file.pairs) or self.recipe.map_file.rest is not None

    @property
    def map_json(self) -> str:
        """The text of the map file."""
        return f"{on_lines(json.loads(_map_text(json.loads(self.key))), 2)}\n"

    @property
    def settings(self) -> dict[str, Any]:
        """The settings that are not defaults, by the names of the command line's options."""
        recipe = self.recipe
        changed = {"clip": recipe.clip, "fps": recipe.fps, "in_place": recipe.writing.in_place or None}
        for given, default in ((recipe.edits, NO_EDITS), (recipe.options, DEFAULT_OPTIONS)):
            changed |= {name: value for name, value in asdict(given).items() if value != getattr(default, name)}
        if recipe.options.objective == "paper":
            changed.pop("supports", None)  # this objective has no supports
        return {name: value for name, value in changed.items() if value is not None}


@dataclass(frozen=True)
class Names:
    """The names of an order's files, which are in one folder."""

    clip: str
    character: str
    output: str  # the suffix of the result, without a point
    animation: str = ""  # one of several in the clip's file
    taken: frozenset[str] = frozenset()  # names of other files, in lower case
    merged: bool = False  # whether the results of all clips are in one file

    @property
    def result(self) -> str:
        """The name of the result."""
        return self.of_kind(self.output)

    @property
    def all(self) -> set[str]:
        """The names of the files that are made for this order alone, in lower case."""
        kinds = ("contacts.json", "map.json", "project.json", *[self.output] * (not self.merged))
        return {self.of_kind(kind).casefold() for kind in kinds}

    def of_kind(self, kind: str) -> str:
        """Return a free name for a file with this suffix, such as "contacts.json". Contacts and maps, which other
        characters may share, are named after the clip alone.
        """
        animation, character = safe_file_name(self.animation), _cut(PurePath(self.character).stem)
        clip = _cut("_".join(filter(None, (PurePath(self.clip).stem, animation))))
        stem = clip if kind in ("contacts.json", "map.json") else f"{clip}_{character}"
        if self.merged and kind == self.output:
            stem = f"{character}_clips"
        taken = {self.clip.casefold(), self.character.casefold(), *self.taken}
        names = (f"{stem}{number or ''}.{kind}" for number in count())
        return next(name for name in names if name.casefold() not in taken)

    def command(self, order: Order, add: bool = False) -> str:
        """Return the command line that makes the result, or with `add` adds to it, in a folder with the files."""
        words = ["distretarget", _as_argument(self.clip), _as_argument(self.character)]
        words += ["-o", _as_argument(self.result), *["--add"] * add]
        for name, value in order.settings.items():
            flag = f"--{name.replace('_', '-')}"
            words += [flag] if value is True else [flag, str(value)]
        words += ["--contacts", _as_argument(self.of_kind("contacts.json"))] if order.contacts.entries else []
        words += ["--map", _as_argument(self.of_kind("map.json"))] if order.has_map else []
        return shlex.join(words)


def _map_text(given: Mapping[str, Any]) -> str:
    """The text of the map file for an order as the page sends it."""
    pairs = given.get("map") or {}
    return json.dumps(MAP_HEADER | {"map": pairs, "rest": given["rest"]} if given.get("rest") else pairs)


def _cut(name: str) -> str:
    """The name, cut so that two of them fit into the name of a file."""
    return name.encode()[:LONGEST].decode(errors="ignore")


def _as_argument(name: str) -> str:
    """The name of a file, written so that it is taken neither for an option nor for a command."""
    return name if "." in name.strip(".") and not name.startswith("-") else f"./{name}"


@dataclass(frozen=True)
class Project:
    """A project file: the order that the page shows, and the names of its files, which are beside it."""

    order: Order
    names: Names
    folder: Path

    @property
    def defaults(self) -> dict[str, Any]:
        """The defaults that the project gives the command line, by the names of its parameters."""
        files = {"source": self.folder / self.names.clip, "target": self.folder / self.names.character}
        return {name: str(value) for name, value in files.items()} | {"output": self.names.result} | self.order.settings

    def with_map(self, recipe: Recipe) -> Recipe:
        """Return a recipe with the order's map, and with its rest pose unless the recipe has one."""
        own = self.order.recipe.map_file
        return replace(recipe, map_file=replace(own, rest=recipe.map_file.rest or own.rest))


def project_to_json(orders: Sequence[Order], output: str, files: Mapping[str, InputFile]) -> str:
    """Return the text of a project file of a character's orders, the first of which is shown on the page; of the others
    it has the fields `OF_CLIP`. `files` are theirs by id, `output` the suffix of the result.
    """

    def settings(order: Order, names: Sequence[str]) -> dict[str, object]:
        given = json.loads(order.key) | {"contacts": json.loads(contacts_to_json(order.contacts))["contacts"]}
        return {name: given[name] for name in names if given.get(name)}

    abouts = {file_id: {"name": str(file.path), "hash": file.hash} for file_id, file in files.items()}
    shown, *others = orders
    of_shown = {"files": {role: abouts[getattr(shown, role)] for role in FILES}, "output": output}
    other_clips = [abouts[each.clip] | settings(each, OF_CLIP) for each in others]
    content = HEADER | of_shown | settings(shown, SETTINGS) | ({"other_clips": other_clips} if others else {})
    return f"{on_lines(content, 2)}\n"


def load_project(path: Path) -> Project:
    """Return the project in a file, whose clip and character are in the same folder.

    Raises:
        FileError: it cannot be read, or its clip or character is missing or has changed.
        SkeletonFileError: it is no project file.
        SettingsError: a setting is invalid.
        ContactsError: a contact is invalid.
    """
    text = read_text(path)
    root = parse_json(path, text)
    found = root.fields((*HEADER, "files", "output"), (*SETTINGS, "other_clips"))
    root.check_header(**HEADER)
    files = found["files"].fields(FILES)
    names = {}
    for role in FILES:
        about = files[role].fields(("name", "hash"))
        name = names[role] = about["name"].text()
        if PurePath(name).name != name or "\\" in name:
            about["name"].expected("the name of a file beside the project")
        found_hash = hash_of_file(path.parent / name)
        if found_hash is None:
            raise FileError(path.parent / name, f"there is no such file; the {role} of {path} belongs beside it")
        if found_hash != about["hash"].text():
            raise FileError(path.parent / name, f"is not the {role} that {path} was made with: its content differs")
    settings = {name: value for name, value in json.loads(text).items() if name in SETTINGS}
    order = Order.of({**names, **settings}, path)
    file_names = Names(names["clip"], names["character"], found["output"].text(), order.recipe.clip or "")
    return Project(order, file_names, path.parent)
