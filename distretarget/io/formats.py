"""The formats of files, a row each in `FORMATS`: how to tell one, what it may hold, what is written as it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from distretarget.io.files import check_known

Kind = Literal["BVH", "skeleton", "glTF", "FBX", "arrays"]
OutputKind = Literal["BVH", "character", "VRMA", "arrays"]

BEGINNING = 4096  # how far the beginning of a file reaches [bytes]
GLB_MARK = b"glTF"
FBX_MARKS = (b"Kaydara FBX Binary", b"FBXHeaderExtension")  # one of them is at the beginning of an FBX file
NPY_MARK, NPZ_MARK = b"\x93NUMPY", b"PK\x03\x04"
JSON_START = re.compile(rb"[\xef\xbb\xbf\xff\xfe \t\r\n\0]*[{\[]")  # after marks of the byte order
GLTF_ASSET = re.compile(rb'"asset"\s*:\s*\{')  # in every .gltf file, in no skeleton file


@dataclass(frozen=True)
class Format:
    """A format of files."""

    kind: Kind
    name: str  # in messages, after "is"
    is_in: Callable[[bytes, str], bool]  # whether a content, in a file with this ending, shows that it has the format
    outputs: Mapping[str, OutputKind] = field(default_factory=dict)  # what is written to files with these endings
    motions: tuple[str, ...] = ()  # the endings of files that may be motions
    others: tuple[str, ...] = ()  # the endings of files that are none, but bodies or arrays
    has_characters: bool = False  # whether it has characters: skeletons with meshes
    unwritten: str = ""  # why it is not written


def _is_gltf(content: bytes, ending: str) -> bool:
    is_text = JSON_START.match(content) and (ending == ".gltf" or GLTF_ASSET.search(content) is not None)
    return content.startswith(GLB_MARK) or bool(is_text)


BVH = Format("BVH", "BVH", lambda _, __: False, {".bvh": "BVH"}, (".bvh",))  # any text may be meant as BVH
GLTF = Format(
    "glTF",
    "glTF",
    _is_gltf,
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

FORMATS = (BVH, GLTF, ARRAYS, FBX, SKELETON)  # the first that a content shows is its format
MOTION_SUFFIXES = tuple(suffix for each in FORMATS for suffix in each.motions)
OUTPUTS = {suffix: kind for each in FORMATS for suffix, kind in each.outputs.items()}
OUTPUT_FORMATS = ("own", *(suffix[1:] for suffix in OUTPUTS))  # of results; "own" is the target's own


def format_of_name(path: str | Path) -> Format | None:
    """Return the format that the ending of a file's name says, or None."""
    suffix = Path(path).suffix.lower()
    return next((each for each in FORMATS if suffix in each.motions + each.others), None)


def format_of(content: bytes, path: str | Path) -> Format:
    """Return the format that content or name shows, else BVH; a FileError if other programs have to convert it."""
    suffix = Path(path).suffix.lower()
    if shown := next((each for each in FORMATS if each.is_in(content, suffix)), None):
        return shown
    check_known(path)
    named = format_of_name(path)
    return named if named and named is not ARRAYS else BVH
