"""Motions from files of all kinds: BVH, glTF, VRM, VRM animations, FBX."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from types import NoneType

from distretarget.checks import check_kind, check_number, check_path
from distretarget.errors import DistretargetError, FileError, MotionError
from distretarget.io.array_motion import array_motion
from distretarget.io.bvh import parse_bvh
from distretarget.io.character_file import read_scene, shown_character
from distretarget.io.input_file import InputFile, load_file
from distretarget.motion import LONGEST_FRAME, SHORTEST_FRAME, Motion


def read_motion(
    path: str | Path, clip: str | None = None, fps: float | None = None, *, joints: str | Path | None = None
) -> Motion:
    """Return the motion in a file: BVH, glTF 2.0 (.glb, .gltf), VRM 0 or 1, VRM animation (.vrma), FBX, or arrays.

    The skeleton of a character file is what its skins use, in the bind pose; its animation is sampled. Arrays, .npz or
    .npy, are parameters of SMPL, SMPL-H or SMPL-X as AMASS has them (`poses`, `trans`), or positions of joints,
    (frames, joints, 3), for which rotations are solved.

    Args:
        path: of the file; its content decides what it is.
        clip: the name of one of several animations in the file, or "#2" for the second.
        fps: the frame rate [frames/s]; the file's own keys if not given. Arrays that do not say theirs have this one.
        joints: the file of the skeleton that arrays are for: one that `load_target` reads, of SMPL also a model, .npz.

    Raises:
        FileError: the file cannot be read or has no such animation.
        BvhError, SkeletonFileError: it is not valid.
        MissingPackageError: it is FBX, and the package ufbx is missing.
        SettingsError: an argument has the wrong type, or is out of bounds.

    Warns:
        UserWarning: of what is left out, such as scales that change.
    """
    check_kind("clip", clip, str, NoneType)
    if fps is not None:
        check_number("fps", fps, 1 / LONGEST_FRAME, 1 / SHORTEST_FRAME)
    check_path("path", path)
    file = load_file(path) if joints is None else replace(load_file(path), joints=load_file(joints))
    motion, notes = parse_motion(file, clip, fps)
    for note in notes:
        warnings.warn(note, stacklevel=2)
    return motion


def parse_motion(file: InputFile, clip: str | None = None, fps: float | None = None) -> tuple[Motion, tuple[str, ...]]:
    """Return the motion in a file as `read_motion` does, and what is left out, a line each."""
    match file.kind:
        case "skeleton":
            raise FileError(file.path, "is a skeleton file, which has no motion; expected a BVH, glTF, VRM or FBX file")
        case "BVH":
            motion = parse_bvh(file.text, file.path)
            if clip is not None:
                raise FileError(file.path, "is BVH, which holds one motion without a name; leave out clip")
            try:
                return (motion.resampled(f"{1 / fps:.9g}") if fps else motion), ()
            except MotionError as error:
                raise error.in_file(file.path) from None
        case "arrays":
            return array_motion(file, fps), ()
    scene = read_scene(file, clip, fps)
    if scene.animation is None:
        raise FileError(file.path, "has no animation; expected a file with a motion")
    character = shown_character(scene)
    try:
        motion = character.motion(scene.animation, len(file.content) + sum(map(len, file.beside.values())))
    except DistretargetError as error:
        raise error.in_file(file.path) from None
    return motion, character.warnings
