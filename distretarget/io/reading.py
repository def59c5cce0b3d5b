"""Read files of all formats: targets with their meshes, builds of bodies, and motions."""

from __future__ import annotations

import warnings
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import NoneType

import numpy as np
from numpy.typing import NDArray

from distretarget.body.body import Body
from distretarget.body.build import BUILDS, Build, Builds, average_build, bare_mesh, capsules_of
from distretarget.body.single_bones import on_ends, with_ends
from distretarget.character.character import Character
from distretarget.character.from_scene import character_of
from distretarget.character.mesh import skinned_mesh
from distretarget.character.nodes import CharacterScene
from distretarget.checks import check_kind, check_number, check_path
from distretarget.errors import BvhError, DistretargetError, FileError, MotionError, SkeletonFileError, in_file, quoted
from distretarget.io.arrays import ArraysFile
from distretarget.io.bvh import bvh_warnings, parse_bvh, parse_bvh_skeleton
from distretarget.io.fbx import fbx_mesh, parse_fbx
from distretarget.io.gltf import Gltf
from distretarget.io.gltf_scene import Face, animation_names, face_of, gltf_materials, gltf_parts, gltf_scene
from distretarget.io.gltf_writer import gltf_character
from distretarget.io.input_file import InputFile, Source, load_file
from distretarget.io.json_node import parse_json
from distretarget.io.skeleton_json import skeleton_target
from distretarget.io.smpl import PARTS, array_skeleton, smpl_motion
from distretarget.motion import FASTEST, SLOWEST, Motion, check_reach, is_frame_time
from distretarget.numerics.rotations import from_represented
from distretarget.numerics.vectors import Array
from distretarget.skeleton import Skeleton
from distretarget.skin.mesh import SkinnedMesh
from distretarget.target import LoadedTarget, SkeletonEdit, Target, with_bones

VERTICES = b"Vertices"  # in FBX files with a mesh, binary or text
OWN_ARRAYS = ("local_rotations", "root_path")  # among those that `write_npz` writes
POSITIONS = "positions"  # the name of joint positions in a file with several arrays of that shape
RATE_KEYS = ("mocap_framerate", "mocap_frame_rate", "fps")  # names of the frame rate in files of arrays


def read_character_scene(
    file: InputFile, clip: str | None = None, fps: float | None = None, animated: bool = True
) -> CharacterScene:
    """Return the nodes and skins of a glTF or FBX file, and an animation if `animated`."""
    if file.kind == "FBX":
        return parse_fbx(file.content, file.path, clip, fps, animated)
    return gltf_scene(file.gltf, clip, fps, animated)


def animations_in(file: InputFile) -> tuple[str, ...]:
    """Return the names of the animations in a glTF or FBX file, which may be empty or equal; () for other files."""
    if file.kind == "glTF":
        return animation_names(file.gltf)
    return read_character_scene(file, animated=False).animations if file.kind == "FBX" else ()


@dataclass(frozen=True, eq=False)
class CharacterMesh:
    """The mesh of a character, which a call reads, once, and returns; None if there is none or it cannot be read."""

    file: InputFile
    character: Character

    def __call__(self) -> SkinnedMesh | None:
        return self._read[0]

    def __getstate__(self) -> dict[str, object]:
        """Pickle the mesh, for a worker, without the file."""
        return {"_read": self._read}

    @property
    def warnings(self) -> tuple[str, ...]:
        """Why the mesh could not be read, and what of it could not be converted to glTF, as far as that was tried."""
        unread = self._read[1] if "_read" in vars(self) else ()
        return *unread, *(self.as_gltf[1] if "as_gltf" in vars(self) else ())

    @cached_property
    def as_gltf(self) -> tuple[Gltf, tuple[str, ...]]:
        """The character of an FBX file as glTF, and what is left out; see `gltf_character`."""
        return gltf_character(self.file, self.character)

    @cached_property
    def _read(self) -> tuple[SkinnedMesh | None, tuple[str, ...]]:
        try:
            if self.file.kind == "FBX":
                if VERTICES not in self.file.content:
                    return None, ()
                return skinned_mesh(self.character, *fbx_mesh(self.file.content, self.file.path)[:2]), ()
            scene = gltf_scene(self.file.gltf, animated=False)
            parts = tuple(gltf_parts(self.file.gltf, scene.skins))
            return skinned_mesh(self.character, scene.nodes, parts, gltf_materials(self.file.gltf)), ()
        except DistretargetError as error:
            why = error.in_file(self.file.path)
            return None, (f"its mesh is not read, so that the body gets an average thickness: {why}",)


@dataclass(frozen=True, eq=False, kw_only=True)
class CharacterTarget(Target):
    """A target whose joints are nodes of a character file."""

    character: Character
    mesh: CharacterMesh
    face: Face | None = None  # expressions; None for FBX

    @property
    def warnings(self) -> tuple[str, ...]:
        """What of the file is left out, a line each."""
        return *self.character.warnings, *self.mesh.warnings


@dataclass(frozen=True, eq=False)
class TargetFile:
    """The target in a file, the file's path for errors, and the file itself, or None in workers."""

    target: LoadedTarget
    path: str | Path
    file: InputFile | None

    @classmethod
    def of(cls, file: InputFile) -> TargetFile:
        """Return the target in a file; errors as in `load_target`."""
        return cls(parse_target(file), file.path, file)


def load_target(path: Source) -> LoadedTarget:
    """Return the target in a skeleton file (full or short form), a BVH file, or the file of a character: glTF 2.0
    (.glb, .gltf), VRM 0 or 1, FBX; `path` may also be its bytes or a file object opened as binary. The format is
    recognised by the content.

    `retarget` takes the result; its method `for_source` returns the skeleton for a given source.

    Raises:
        FileError: the file cannot be read, or has no character.
        SkeletonFileError, BvhError: the file is not valid, or all its bones have length 0.
    """
    return parse_target(load_file(path))


def parse_target(file: InputFile) -> LoadedTarget:
    """Return the target in a file as `load_target` does."""
    match file.kind:
        case "skeleton":
            return skeleton_target(parse_json(file.path, file.text))
        case "BVH":
            text, path = file.text, file.path
            with suppress(BvhError, MotionError):  # its MOTION may be missing or invalid
                motion = parse_bvh(text, path)
                check_reach(motion, "its motion")
                return Target(with_bones(motion.rigid_skeleton, path), {}, "", motion if len(motion) else None)
            return Target(with_bones(parse_bvh_skeleton(text, path), path), {}, "")
        case "arrays":
            return Target(with_bones(array_skeleton(file.arrays), file.path), {}, "")
    character = character_of(read_character_scene(file, animated=False))
    mesh = CharacterMesh(file, character)
    skeleton = with_ends(with_bones(character.skeleton, file.path), mesh)
    face = face_of(file.gltf) if file.kind == "glTF" else None
    return CharacterTarget(skeleton, {}, "", character=character, mesh=mesh, face=face)


def parse_full_target(file: InputFile) -> Target:
    """Return the target in a file as `parse_target` does; a SkeletonFileError for the short form of skeleton files."""
    target = parse_target(file)
    if isinstance(target, SkeletonEdit):
        raise SkeletonFileError(file.path, "", 'has no "joints"; this short form needs a source to change')
    return target


def load_build(path: str | Path) -> Build:
    """Return the build of a body, its thickness, to be put on any recognised body: from a character's mesh (GLB, glTF,
    VRM, FBX), from a skeleton file with radii, or an average one by name: "adult", "child", "baby", "old", "thin",
    "fat" or "muscular".

    Raises:
        FileError: the file cannot be read, has no mesh or radii, or no human body is recognised in it; or no average
            build has this name.
        SkeletonFileError, BvhError: it is not valid.
        SettingsError: `path` is neither a path nor a name.
    """
    check_path("path", path)
    if str(path) in BUILDS:
        return average_build(str(path))
    if not Path(path).suffix and not Path(path).exists():
        raise FileError(path, f"is neither a file nor an average build ({', '.join(BUILDS)})")
    file = load_file(path)
    return build_of(parse_full_target(file), file.path)


def build_of(target: Target, path: str | Path) -> Build:
    """Return the build of a target's body; a FileError, which names `path`, if it has neither a mesh nor radii."""
    body, mesh = Body.of(target.skeleton, target.motion), target.mesh()
    if body.anatomy is None:
        raise FileError(path, "shows no human body, so that another body cannot be as thick as it")
    if mesh is None and not target.radii:
        raise FileError(path, "does not show how thick its body is; expected a GLB, VRM or FBX with a mesh")
    return Build.of(body, capsules_of(body, mesh, target.radii), mesh and bare_mesh(body, mesh))


def with_source(builds: Builds, file: InputFile) -> Builds:
    """Return the builds with the source's from the mesh in its file, if it has one and none was given."""
    if builds.source is not None or not file.format.has_characters:
        return builds
    with suppress(DistretargetError):
        return replace(builds, source=build_of(parse_full_target(file), file.path))
    return builds


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
