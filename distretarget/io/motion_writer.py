"""Write motions in the format that a file name's suffix says: BVH, a character file, a VRM animation, or arrays."""

from __future__ import annotations

import io
import reprlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from types import NoneType
from typing import IO, Protocol, cast, get_args

import numpy as np

from distretarget.body.tree_repairs import without_ends
from distretarget.character.nodes import Animation
from distretarget.checks import brief_repr, check_choice, check_kind
from distretarget.errors import FileError, MotionError, SettingsError
from distretarget.io.arrays import Arrays, Precision, npz
from distretarget.io.bvh_writer import bvh_parts
from distretarget.io.files import encoded_parts, read_bytes, write_whole
from distretarget.io.gltf import inside
from distretarget.io.gltf_scene import gltf_nodes
from distretarget.io.gltf_writer import Mode, Parts, animated
from distretarget.io.input_file import OUTPUT_FORMATS, OUTPUTS, InputFile, OutputKind, Source, format_of_name, load_file
from distretarget.io.json_node import Node
from distretarget.io.reading import CharacterTarget, TargetFile
from distretarget.io.smpl import smpl_parameters
from distretarget.io.vrma import as_humanoid, vrma
from distretarget.motion import Motion, single_precision
from distretarget.numerics.rotations import RotationKind
from distretarget.numerics.vectors import Array, level

Y_UP = np.array([0.0, 1.0, 0.0])
PATH_KEY = "root_path"  # in the extras of an animation in place: the root's position in each frame [file units]


class Labelled(Protocol):
    """A motion with labels of its frames, arrays by name, such as a `RetargetResult`."""

    @property
    def motion(self) -> Motion: ...

    @property
    def labels(self) -> Arrays: ...


def output_kind(path: str | Path, target: InputFile | None) -> OutputKind:
    """Return the kind of file that the suffix of an output means; a FileError if the target cannot be written so."""
    suffix, named = Path(path).suffix.lower(), format_of_name(path)
    if named and named.unwritten:
        raise FileError(path, named.unwritten)
    if suffix not in OUTPUTS:
        usual = ".glb" if target and target.kind == "glTF" else ".bvh"
        better = Path(path).with_suffix(usual) if Path(path).name else usual
        endings = ", ".join(OUTPUTS)
        raise FileError(path, f"the ending says what to write; expected one of {endings}, such as {str(better)!r}")
    kind, what = OUTPUTS[suffix], f"{suffix} is the target's own file with the motion"
    if kind == "character" and target is None:
        raise FileError(path, f"{what}; give the character's file")
    if kind == "character" and target and not target.format.has_characters:
        raise FileError(path, f"{what}, but {str(target.path)!r} is {target.format.name}; write .bvh")
    if suffix == ".vrm" and target:
        extensions = target.gltf.document.inner("extensions") if target.kind == "glTF" else {}
        if {"VRM", "VRMC_vrm"}.isdisjoint(extensions):
            raise FileError(path, f"{str(target.path)!r} is no VRM model; write .glb")
    return kind


def suffix_of(target: TargetFile, kind: str | None = None) -> str:
    """Return the suffix of results of a `kind`, by default the target's own; a FileError if it cannot be written."""
    suffix, own = f".{kind}" if kind else ".bvh", Path(target.path).suffix.lower()
    if kind is None and target.file is not None and target.file.kind == "glTF":
        suffix = own if own in OUTPUTS else ".glb"
    output_kind(f"*{suffix}", target.file)
    return suffix


def write_motion(
    path: str | Path | IO[bytes],
    motion: Motion | Labelled,
    character: Source | None = None,
    *,
    kind: str | None = None,
    name: str | None = None,
    animations: Mode = "add",
    in_place: bool = False,
    overwrite: bool = False,
) -> None:
    """Write a motion to a file, complete or not at all: BVH (.bvh), a VRM animation (.vrma), arrays (.npz), or a
    character's file with the motion as an animation (.glb, .gltf, .vrm).

    Args:
        path: of the file; its suffix says the format. Or a file object opened as binary.
        motion: the motion; with a `RetargetResult`, arrays also hold the labels of its frames.
        character: the character's file, as `load_target` takes it; not needed for .bvh and .npz.
        kind: the format for a file object: "bvh", "glb", "gltf", "vrm", "vrma" or "npz".
        name: of the animation; by default the file's name without suffix.
        animations: "add" it to those in the character's file, or "replace" them.
        in_place: whether to leave out the root's path along the floor, so that it stays above its first position.
        overwrite: whether to replace a file that exists.

    Raises:
        FileError: the file exists and `overwrite` is false, or it or the character cannot be written.
        MotionError: the motion has other joints than the character.
        SettingsError: `path` is a file object, and `kind` does not say what to write.
    """
    moved, place = _motion_of(motion), Path(f"motion.{kind}")
    if isinstance(path, str | PathLike):
        place = Path(path)
    else:
        if not hasattr(path, "writelines") or isinstance(path, io.TextIOBase):
            raise SettingsError(f"path is {reprlib.repr(path)}; expected a path, or a file opened as binary")
        check_choice("kind", kind, OUTPUT_FORMATS[1:])
    check_kind("name", name, str, NoneType)
    check_choice("animations", animations, ("add", "replace"))
    target = TargetFile.of(load_file(character)) if character is not None else None
    settings = OutputSettings(animations, in_place)
    clip = settings.clip(moved, name or place.stem)
    if output_kind(place, target.file if target else None) == "arrays":
        clip = replace(clip, labels={} if isinstance(motion, Motion) else motion.labels)
    content = content_of(place, clip, target, settings)
    if isinstance(path, str | PathLike):
        write_whole(path, content, overwrite)
    else:
        path.writelines(encoded_parts(content))


def _motion_of(given: object) -> Motion:
    motion = getattr(given, "motion", given)
    check_kind("motion", motion, Motion)
    return cast(Motion, motion)


def write_npz(
    path: str | Path,
    motion: Motion | Labelled,
    rotations: RotationKind = "quaternion",
    overwrite: bool = False,
    precision: Precision = "float64",
) -> None:
    """Write the arrays of `Motion.to_dict` to an npz file, complete or not at all; "float32" makes it half as large. A
    `RetargetResult` adds the labels of its frames, a body of SMPL `poses` and `trans`.

    `numpy.load(path)` reads them, without pickle. Equal motions make equal files.

    Raises:
        FileError: the file exists and `overwrite` is false, or it cannot be written.
    """
    moved = _motion_of(motion)
    check_choice("precision", precision, get_args(Precision))
    settings = OutputSettings(rotations=rotations, precision=precision)
    labels = {} if isinstance(motion, Motion) else motion.labels
    write_whole(path, settings.arrays(NamedClip(moved, "", {}, labels)), overwrite)


@dataclass(frozen=True)
class NamedClip:
    """A motion to write, and its name; `labels` of its frames by name, `weights` of morph targets by node."""

    motion: Motion
    name: str
    extras: Mapping[str, object]
    labels: Arrays = field(default_factory=dict)
    weights: Mapping[int, Array] = field(default_factory=dict)


@dataclass(frozen=True, repr=False)
class OutputSettings:
    """How motions are written.

    Attributes:
        animations: "add" animations to those in a character's file, or "replace" them.
        in_place: whether the root's path along the floor is left out.
        rotations: in arrays: "quaternion" (x y z w), "matrix", or "6d", the matrix's first two columns.
        precision: of the numbers in arrays.
    """

    animations: Mode = "add"
    in_place: bool = False
    rotations: RotationKind = "quaternion"
    precision: Precision = "float64"

    __repr__ = brief_repr

    def arrays(self, clip: NamedClip) -> bytes:
        """Return the content of an npz file with the arrays of a clip, its labels, and a SMPL body's parameters."""
        own = cast(Arrays, clip.motion.to_dict(self.rotations))
        return npz({**own, **smpl_parameters(clip.motion), **clip.labels}, self.precision)

    def clip(self, motion: Motion, name: str, up: Array = Y_UP) -> NamedClip:
        """Return a motion as it is written; `in_place` keeps the root above its first position. `up` has length 1."""
        if not self.in_place:
            return NamedClip(motion, name, {})
        path = level(motion.root_positions, up)
        in_place = replace(motion, root_positions=motion.root_positions - path + path[:1])
        return NamedClip(in_place, name, {PATH_KEY: motion.root_positions.round(6).tolist()})


DEFAULT_OUTPUT = OutputSettings()


def content_of(
    path: str | Path,
    clip: NamedClip,
    target: TargetFile | None,
    settings: OutputSettings,
    onto: InputFile | None = None,
) -> Iterable[str] | Parts:
    """Return the content of a file with a clip, in parts; errors as in `write_motion` and `with_animations`."""
    match output_kind(path, target.file if target else None):
        case "BVH":
            return bvh_parts(clip.motion)
        case "VRMA":
            return vrma(clip.motion, clip.name, clip.extras)
        case "arrays":
            return [settings.arrays(clip)]
    assert target is not None
    return with_animations(path, target, [character_animation(target, clip)], settings.animations, onto)


def as_written(
    motion: Motion, kind: OutputKind, precision: Precision = "float64", target: TargetFile | None = None
) -> Motion:
    """Return a motion with the losses of a kind of file, to measure what was written: single precision in glTF,
    `precision` in arrays, a humanoid's bones in a VRM animation. BVH counts as exact, to 1e-8.
    """
    match kind:
        case "BVH":
            return motion
        case "VRMA":
            return single_precision(as_humanoid(motion))
        case "arrays":
            return motion if precision == "float64" else single_precision(motion)
    assert target is not None
    assert isinstance(target.target, CharacterTarget)
    return target.target.character.in_single_precision(motion)


def character_animation(target: TargetFile, clip: NamedClip) -> Animation:
    """Return a clip as an animation of its character's nodes; a MotionError if the character has other joints."""
    assert isinstance(target.target, CharacterTarget)
    character = target.target.character
    motion, expected = without_ends(clip.motion), character.skeleton
    found = motion.skeleton
    if found.names != expected.names or not np.array_equal(found.parents, expected.parents):
        raise MotionError(f"the motion has other joints than {str(target.path)!r}; retarget it to that character")
    motion = motion if found.faces_negative_z == expected.faces_negative_z else motion.turned_round()
    return replace(character.animation(motion, clip.name), extras=clip.extras, weights=clip.weights)


def with_animations(
    path: str | Path, target: TargetFile, animations: Sequence[Animation], mode: Mode, onto: InputFile | None = None
) -> Parts:
    """Return the content of a character's file with animations, in parts: JSON if `path` ends in .gltf, else a GLB.
    Other files are embedded, unless .gltf is written beside them. `onto` is an earlier result, whose animations stay.
    """
    assert target.file is not None
    file, folder, as_binary = target.file, Path(target.file.path).parent, Path(path).suffix.lower() != ".gltf"
    stays = not file.has_folder or (not as_binary and Path(path).parent.resolve() == folder.resolve())

    def embedded(uri: Node) -> bytes:
        name = uri.text()
        return file.beside[name] if name in file.beside else read_bytes(inside(uri, folder, name))

    try:
        assert isinstance(target.target, CharacterTarget)
        plain = target.target.mesh.as_gltf[0] if file.kind == "FBX" else file.gltf
        if onto is None:
            return animated(plain, animations, mode, as_binary, None if stays or file.kind == "FBX" else embedded)
        a, b = gltf_nodes(onto.gltf), gltf_nodes(plain)
        if a.names != b.names or not np.allclose(a.transforms, b.transforms):
            raise FileError(onto.path, f"is no result on {str(target.path)!r}, and is not added to; give another name")
        own = len(plain.entries("animations")) if mode == "add" else 0
        return animated(onto.gltf, animations, "add", as_binary, own=own)
    except RecursionError:
        raise FileError(target.path, "is nested too deeply") from None
