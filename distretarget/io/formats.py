"""File formats, one row each in `FORMATS`: how to recognise a format, what it may hold, what is written in it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from distretarget.io.files import check_known

Kind = Literal["BVH", "skeleton", "glTF", "FBX", "arrays"]
OutputKind = Literal["BVH", "character", "VRMA", "arrays"]

BEGINNING = 4096  # the first bytes of a file, in which `FBX_MARKS` are looked for
GLB_MARK = b"glTF"
FBX_MARKS = (b"Kaydara FBX Binary", b"FBXHeaderExtension")  # in binary FBX files, and in those that are text
NPY_MARK, NPZ_MARK = b"\x93NUMPY", b"PK\x03\x04"
JSON_START = re.compile(rb"[\xef\xbb\xbf\xff\xfe \t\r\n\0]*[{\[]")  # after a byte order mark
GLTF_ASSET = re.compile(rb'"asset"\s*:\s*\{')  # in every .gltf file, in no skeleton file


@dataclass(frozen=True)
class Format:
    """A file format."""

    kind: Kind
    name: str  # in messages, after "is"
    matches: Callable[[bytes, str], bool]  # whether the content of a file with this suffix has the format
    outputs: Mapping[str, OutputKind] = field(default_factory=dict)  # what is written, by suffix
    motions: tuple[str, ...] = ()  # suffixes of files that may hold a motion
    others: tuple[str, ...] = ()  # suffixes of files that hold bodies or arrays only
    has_characters: bool = False  # whether it can hold characters: skeletons with meshes
    unwritten: str = ""  # for messages: that it is not written, and what to write instead


BVH = Format("BVH", "BVH", lambda _, __: False, {".bvh": "BVH"}, (".bvh",))  # any other text is taken for BVH
GLTF = Format(
    "glTF",
    "glTF",
    lambda content, suffix: (
        content.startswith(GLB_MARK)
        or bool(JSON_START.match(content) and (suffix == ".gltf" or GLTF_ASSET.search(content)))
    ),
    {".glb": "character", ".gltf": "character", ".vrm": "character", ".vrma": "VRMA"},
    motions=(".glb", ".gltf", ".vrma"),
    others=(".vrm",),
    has_characters=True,
)
FBX = Format(
    "FBX",
    "FBX",
    lambda content, _: any(mark in content[:BEGINNING] for mark in FBX_MARKS),
    motions=(".fbx",),
    has_characters=True,
    unwritten="FBX is read, but not written; write .glb, which Blender, Unreal, Unity, Godot and Maya read",
)
ARRAYS = Format(
    "arrays",
    "a file of arrays",
    lambda content, _: content.startswith((NPY_MARK, NPZ_MARK)),
    {".npz": "arrays"},
    others=(".npz", ".npy"),
)
SKELETON = Format("skeleton", "a skeleton file", lambda content, _: JSON_START.match(content) is not None)

FORMATS = (BVH, GLTF, ARRAYS, FBX, SKELETON)  # the first that matches a content is its format
MOTION_SUFFIXES = tuple(suffix for each in FORMATS for suffix in each.motions)
OUTPUTS = {suffix: kind for each in FORMATS for suffix, kind in each.outputs.items()}
OUTPUT_FORMATS = ("own", *(suffix[1:] for suffix in OUTPUTS))  # of results; "own" is the target's format


def format_of_name(path: str | Path) -> Format | None:
    """Return the format with the suffix of a file's name, or None."""
    suffix = Path(path).suffix.lower()
    return next((each for each in FORMATS if suffix in each.motions + each.others), None)


def format_of(content: bytes, path: str | Path) -> Format:
    """Return the format of a file by its content, else its name, else BVH; a FileError as in `check_known`."""
    suffix = Path(path).suffix.lower()
    if matching := next((each for each in FORMATS if each.matches(content, suffix)), None):
        return matching
    check_known(path)
    named = format_of_name(path)
    return named if named and named is not ARRAYS else BVH
