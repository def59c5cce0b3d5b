"""Scenes that commands read: a scene file, or a folder with a BVH file for each performer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from distretarget.body.body import Body
from distretarget.errors import FileError
from distretarget.io.bvh import read_bvh
from distretarget.io.files import is_folder, reason_of
from distretarget.io.map_json import MapFile, load_map
from distretarget.motion import Motion
from distretarget.scene.scene_file import SCENE_NAME, SceneSetup, load_scene


@dataclass(frozen=True)
class SceneInput:
    """The performers and props of a scene, by name.

    Attributes:
        path: of its file or folder.
        motions: how each moves.
        files: where each was read.
        props: the names of props; None for a folder, which does not say.
        world_scale: the scale of the result's world along the floor, if a scene file says so.
        maps: the map of each performer who has one in a scene file.
    """

    path: Path
    motions: Mapping[str, Motion]
    files: Mapping[str, Path]
    props: frozenset[str] | None = None
    world_scale: float | None = None
    maps: Mapping[str, MapFile] = field(default_factory=dict)


def is_scene(path: Path) -> bool:
    """Return whether a path leads to a scene: a folder, or a file named *.json."""
    return is_folder(path) or path.suffix.lower() == ".json"


def read_scene(path: Path) -> SceneInput:
    """Read the scene in a file, or in a folder: its scene.json, or else all BVH files in it.

    Raises:
        DistretargetError: a file cannot be read, or the folder has no BVH file.
    """
    if not is_folder(path):
        return _of_setup(path, load_scene(path))
    if (path / SCENE_NAME).is_file():
        return _of_setup(path, load_scene(path / SCENE_NAME))
    try:
        inside = [each for each in path.iterdir() if not each.name.startswith(".")]
    except OSError as error:
        raise FileError(path, reason_of(error)) from error
    found = sorted(each for each in inside if each.suffix.lower() == ".bvh")
    if not found:
        raise FileError(path, f"has no BVH file and no {SCENE_NAME} in it")
    files = {each.stem: each for each in found}
    return SceneInput(path, {name: read_bvh(file) for name, file in files.items()}, files)


def props_of(a: SceneInput, b: SceneInput) -> frozenset[str]:
    """Return the names of the props in two scenes: those that a scene file names; without one, clips of A whose bodies
    have no legs beside others that have some.
    """
    for scene in (a, b):
        if scene.props is not None:
            return scene.props
    without_legs = frozenset(name for name, motion in a.motions.items() if Body.of_motion(motion).legs is None)
    return without_legs if len(without_legs) < len(a.motions) else frozenset()


def _of_setup(path: Path, setup: SceneSetup) -> SceneInput:
    sources, props = setup.read()
    motions = dict(zip(setup.names, [*sources, *(prop.motion for prop in props)], strict=True))
    names = frozenset(prop.name for prop in setup.props)
    maps = {one.name: load_map(one.map_path) for one in setup.performers if one.map_path}
    return SceneInput(path, motions, setup.files, names, setup.world_scale, maps)
