"""Read motions from files of all formats: BVH, glTF, VRM, VRM animations, FBX, and arrays with a skeleton."""

from __future__ import annotations

import warnings
from dataclasses import replace
from types import NoneType

import numpy as np
from numpy.typing import NDArray

from distretarget.body.single_bones import on_ends
from distretarget.character.from_scene import character_of
from distretarget.checks import check_kind, check_number
from distretarget.errors import DistretargetError, FileError, in_file, quoted
from distretarget.io.arrays import ArraysFile
from distretarget.io.bvh import bvh_warnings, parse_bvh
from distretarget.io.input_file import InputFile, Source, load_file
from distretarget.io.smpl import PARTS, array_skeleton, smpl_motion
from distretarget.io.target_file import CharacterMesh, parse_full_target, read_character_scene
from distretarget.motion import FASTEST, SLOWEST, Motion, is_frame_time
from distretarget.numerics.rotations import from_represented
from distretarget.numerics.vectors import Array
from distretarget.skeleton import Skeleton

OWN_ARRAYS = ("local_rotations", "root_path")  # among those that `write_npz` writes
POSITIONS = "positions"  # the name of joint positions in a file with several arrays of that shape
RATE_KEYS = ("mocap_framerate", "mocap_frame_rate", "fps")  # names of the frame rate in files of arrays


def read_motion(
    path: Source, clip: str | None = None, fps: float | None = None, *, skeleton: Source | None = None
) -> Motion:
    """Return the motion in a file: BVH, glTF 2.0 (.glb, .gltf), VRM 0 or 1, VRM animation (.vrma), FBX, or arrays.

    A character file gives the joints of its skins, in the bind pose, and a sampled animation. Arrays, .npz or .npy, are
    parameters of SMPL, SMPL-H or SMPL-X as in AMASS (`poses`, `trans`), or joint positions, (frames, joints, 3), for
    which rotations are solved.

    Args:
        path: of the file; or its content as bytes, or a file object opened as binary, which cannot refer to other
            files. The format is recognised by the content.
        clip: the name of one of several animations in the file, or "#2" for the second.
        fps: the frame rate of the result [frames/s]; by default the file's own. Needed for arrays without one.
        skeleton: the file with the skeleton of arrays: any that `load_target` reads; for SMPL also a model's.

    Raises:
        FileError: the file cannot be read or has no such animation.
        BvhError, SkeletonFileError: it is not valid.
        MissingPackageError: it is FBX, and the package ufbx is missing.
        SettingsError: an argument has the wrong type, or is out of bounds.

    Warns:
        UserWarning: something is left out, such as scales that change, or looks wrong, such as the frame time.
    """
    check_kind("clip", clip, str, NoneType)
    if fps is not None:
        check_number("fps", fps, SLOWEST, FASTEST)
    file = load_file(path) if skeleton is None else replace(load_file(path), skeleton=load_file(skeleton))
    motion, notes = parse_motion(file, clip, fps)
    for note in notes:
        warnings.warn(note, stacklevel=2)
    return motion


def parse_motion(file: InputFile, clip: str | None = None, fps: float | None = None) -> tuple[Motion, tuple[str, ...]]:
    """Return the motion in a file and the warnings, a line each, as in `read_motion`."""
    match file.kind:
        case "skeleton":
            raise FileError(file.path, "is a skeleton file, which has no motion; expected a BVH, glTF, VRM or FBX file")
        case "BVH":
            motion = parse_bvh(file.text, file.path)
            if clip is not None:
                raise FileError(file.path, "is BVH, which holds one motion without a name; leave out clip")
            with in_file(file.path):
                return (motion.resampled(f"{1 / fps:.9g}") if fps else motion), tuple(bvh_warnings(file.text, motion))
        case "arrays":
            return _array_motion(file, fps), ()
    scene = read_character_scene(file, clip, fps)
    if scene.animation is None:
        raise FileError(file.path, "has no animation; expected a file with a motion")
    character = character_of(scene)
    with in_file(file.path):
        motion = character.motion(scene.animation, len(file.content) + sum(map(len, file.beside.values())))
        motion = on_ends(motion, CharacterMesh(file, character))
    return motion, character.warnings


def _array_motion(file: InputFile, fps: float | None) -> Motion:
    """The motion in a file of arrays, on the skeleton in `file.skeleton`, or else in the file itself."""
    arrays = file.arrays
    is_smpl = "poses" in arrays or PARTS[1] in arrays
    frame_time = _frame_time(arrays, fps)
    betas = arrays.numbers("betas", "shapes") if is_smpl and "betas" in arrays else np.zeros(0)
    skeleton = _skeleton(file, betas if is_smpl else None)
    try:
        if is_smpl:
            motion = smpl_motion(arrays, skeleton, frame_time)
        elif file.skeleton is None and all(name in arrays for name in OWN_ARRAYS):
            shape, _ = arrays.shape_and_dtype(OWN_ARRAYS[0])
            width = (3, 3) if len(shape) == 4 else (6,) if shape[-1:] == (6,) else (4,)
            rotations = from_represented(arrays.numbers(OWN_ARRAYS[0], "frames", "joints", *width))
            motion = Motion(skeleton, arrays.numbers(OWN_ARRAYS[1], "frames", 3), rotations, frame_time)
        else:
            from distretarget.objectives.positions import motion_of_positions  # slow to import

            positions = _positions(arrays)
            motion = motion_of_positions(skeleton, _joints(arrays, skeleton, positions.shape[1]), positions, frame_time)
        return motion.resampled(f"{1 / fps:.9g}") if fps else motion
    except ValueError as error:
        raise FileError(file.path, "has no rotations, but quaternions of zeros or matrices that mirror") from error
    except DistretargetError as error:
        raise error if isinstance(error, FileError) else error.in_file(file.path) from None


def _frame_time(arrays: ArraysFile, fps: float | None) -> str:
    """The frame time that the file states, or else 1 / fps [s], as text."""
    rate = next((arrays.number(name) for name in RATE_KEYS if name in arrays), fps)
    text = f"{arrays.number('frame_time') if 'frame_time' in arrays else 1 / rate if rate else 0.0:.9g}"
    if not is_frame_time(text):
        raise FileError(arrays.path, "does not say how many frames a second has; expected fps=NUMBER")
    return text


def _skeleton(file: InputFile, betas: Array | None) -> Skeleton:
    """The skeleton of the arrays; a model's in the shape `betas`."""
    if file.skeleton is None:
        if "offsets" in file.arrays:
            return array_skeleton(file.arrays)
        what = "positions of joints" if betas is None else "parameters of SMPL"
        raise FileError(file.path, f"has {what}, but no skeleton that they are for; expected skeleton=FILE")
    if file.skeleton.kind == "arrays":
        return array_skeleton(file.skeleton.arrays, betas)
    return parse_full_target(file.skeleton).skeleton


def _positions(arrays: ArraysFile) -> Array:
    """The positions in a file, (frames, joints, 3): the array `POSITIONS`, or the only one of this shape."""
    if POSITIONS in arrays:
        return arrays.numbers(POSITIONS, "frames", "joints", 3)
    fitting = [name for name in arrays.parts if len(shape := arrays.shape_and_dtype(name)[0]) == 3 and shape[2] == 3]
    if len(fitting) != 1:
        found = quoted(fitting or arrays.parts)
        wanted = f"{POSITIONS}, (frames, joints, 3), or poses and trans of SMPL"
        raise FileError(arrays.path, f"has {found}; expected {wanted}")
    return arrays.numbers(fitting[0], "frames", "joints", 3)


def _joints(arrays: ArraysFile, skeleton: Skeleton, count: int) -> NDArray[np.intp]:
    """The joint of each position, (count,): by the array `names`, else all joints, or all but End Sites."""
    if "names" in arrays:
        return np.array([skeleton.index(str(name)) for name in arrays.array("names").ravel()], np.intp)
    for joints in (np.arange(len(skeleton)), np.array(skeleton.joints)):
        if len(joints) == count:
            return joints
    own = f"{len(skeleton.joints)}, or {len(skeleton)} with End Sites"
    raise FileError(arrays.path, f"has positions of {count} joints; expected as many as the skeleton has, {own}")
