"""Scene files: JSON that says who is in a scene, on which bodies, with which things and options."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import cast, get_args

from distretarget.errors import closest
from distretarget.io.files import read_text
from distretarget.io.json_node import Node, parse_json
from distretarget.performer import Held
from distretarget.scene_setup import PerformerFiles, SceneSetup, ThingFiles
from distretarget.solve.resting_joints import Scene
from distretarget.thing import Grip, ThingScale

FORMAT = "distretarget-scene"
VERSION = 1
SCENE_NAME = "scene.json"  # of scenes in a folder of scenes
HEADER_KEYS = ("format", "version")
OPTION_KEYS = ("things", "world_scale", "supports", "scene", "cut", "resample")


def load_scene(path: str | Path) -> SceneSetup:
    """Return the scene in a file; paths in it start from its folder.

    Raises:
        FileError: the file cannot be read.
        SkeletonFileError: it breaks the format.
    """
    return parse_scene(read_text(path), path)


def parse_scene(text: str, path: str | Path) -> SceneSetup:
    """Return the scene in the text of a file as `load_scene` does."""
    document = Node(path, "", parse_json(path, text))
    fields = document.fields((*HEADER_KEYS, "performers"), OPTION_KEYS)
    for key, known in zip(HEADER_KEYS, (FORMAT, VERSION), strict=True):
        if fields[key].value != known or isinstance(fields[key].value, bool):
            fields[key].expected(json.dumps(known))
    folder = Path(path).parent
    performers = tuple(_performer(node, folder) for node in fields["performers"].items())
    if not performers:
        fields["performers"].expected("at least one performer")
    names = [each.name for each in performers]
    things = tuple(_thing(node, folder, names) for node in fields["things"].items()) if "things" in fields else ()
    _check_names(fields, [*names, *(thing.name for thing in things)])
    return SceneSetup(
        performers=performers,
        things=things,
        world_scale=fields["world_scale"].positive() if "world_scale" in fields else None,
        supports=cast(Held, fields["supports"].one_of(get_args(Held)) if "supports" in fields else "hold"),
        scene=cast(Scene, fields["scene"].one_of(get_args(Scene)) if "scene" in fields else "body"),
        cut="cut" in fields and fields["cut"].flag(),
        resample="resample" in fields and fields["resample"].flag(),
    )


def _performer(node: Node, folder: Path) -> PerformerFiles:
    fields = node.fields(("source", "target"), ("name", "map", "start"))
    source = folder / fields["source"].text()
    return PerformerFiles(
        name=_name(fields["name"]) if "name" in fields else source.stem,
        source=source,
        target=folder / fields["target"].text(),
        map_path=folder / fields["map"].text() if "map" in fields else None,
        start=_start(fields),
    )


def _thing(node: Node, folder: Path, performers: Sequence[str]) -> ThingFiles:
    fields = node.fields(("name",), ("file", "prop", "scale", "held_by", "start"))
    if ("file" in fields) == ("prop" in fields):
        node.fail('expected either "file" or "prop"')
    held_by = fields["held_by"].items() if "held_by" in fields else []
    return ThingFiles(
        name=_name(fields["name"]),
        origin=folder / fields["file"].text() if "file" in fields else _grip(fields["prop"], performers),
        scale=_scale(fields["scale"], performers) if "scale" in fields else "world",
        held_by=tuple(_grip(each, performers) for each in held_by),
        start=_start(fields),
    )


def _grip(node: Node, performers: Sequence[str]) -> Grip:
    fields = node.fields(("performer", "joint"), ())
    return Grip(_number(fields["performer"], performers), fields["joint"].text())


def _scale(node: Node, performers: Sequence[str]) -> ThingScale:
    if isinstance(node.value, float):
        return node.positive()
    return "world" if node.text() == "world" else _number(node, performers)


def _number(node: Node, performers: Sequence[str]) -> int:
    """The number of the performer with this name."""
    if node.text() not in performers:
        node.fail(f"no performer {node.text()!r}; {closest(node.text(), performers)}")
    return performers.index(node.text())


def _name(node: Node) -> str:
    """A name that can be that of a file."""
    name = node.name()
    if name in (".", "..") or "/" in name or "\\" in name:
        node.expected("a name without slashes")
    return name


def _start(fields: dict[str, Node]) -> float:
    if "start" not in fields:
        return 0.0
    if fields["start"].number() < 0:
        fields["start"].expected("a time in seconds, from 0")
    return fields["start"].number()


def _check_names(fields: dict[str, Node], names: Sequence[str]) -> None:
    for number, name in enumerate(names):
        if name in names[:number]:
            fields["performers"].fail(f"{name!r} is the name of two performers or things; give one of them another")
