"""Targets in files: BVH, characters (glTF, VRM, FBX) with their meshes, skeleton files; and how thick bodies are."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from distretarget.body.bare import bare_mesh
from distretarget.body.body import Body
from distretarget.body.build import BUILDS, Build, Builds, average_build, capsules_of
from distretarget.body.single_bones import with_ends
from distretarget.character.character import Character
from distretarget.character.from_scene import character_of
from distretarget.character.mesh import skinned_mesh
from distretarget.character.nodes import CharacterScene
from distretarget.checks import check_path
from distretarget.errors import BvhError, DistretargetError, FileError, MotionError, SkeletonFileError
from distretarget.io.bvh import parse_bvh, parse_bvh_skeleton
from distretarget.io.expressions import Face, face_of
from distretarget.io.fbx import fbx_mesh, parse_fbx
from distretarget.io.gltf import Gltf
from distretarget.io.gltf_scene import animation_names, gltf_materials, gltf_parts, gltf_scene
from distretarget.io.gltf_writer import gltf_character
from distretarget.io.input_file import InputFile, Source, load_file
from distretarget.io.json_node import parse_json
from distretarget.io.skeleton_json import skeleton_target
from distretarget.io.smpl import array_skeleton
from distretarget.motion import check_reach
from distretarget.skin.mesh import SkinnedMesh
from distretarget.target import LoadedTarget, SkeletonEdit, Target, with_bones

VERTICES = b"Vertices"  # in FBX files with a mesh, binary or text


def read_character_scene(
    file: InputFile, clip: str | None = None, fps: float | None = None, animated: bool = True
) -> CharacterScene:
    """Return the nodes, skins and an animation of a glTF or FBX file; without it if not `animated`."""
    if file.kind == "FBX":
        return parse_fbx(file.content, file.path, clip, fps, animated)
    return gltf_scene(file.gltf, clip, fps, animated)


def animations_in(file: InputFile) -> tuple[str, ...]:
    """Return the names of the animations in a file, which may be empty or the same; none in other files than these."""
    if file.kind == "glTF":
        return animation_names(file.gltf)
    return read_character_scene(file, animated=False).animations if file.kind == "FBX" else ()


@dataclass(frozen=True, eq=False)
class CharacterMesh:
    """The mesh of a character, read from its file when it is first asked for; called, it returns it, or None where
    there is none or none can be read.
    """

    file: InputFile
    character: Character

    def __call__(self) -> SkinnedMesh | None:
        return self._read[0]

    def __getstate__(self) -> dict[str, object]:
        """What goes to a worker: the mesh, not the file."""
        return {"_read": self._read}

    @property
    def warnings(self) -> tuple[str, ...]:
        """Lines that say why the mesh could not be read, and what of it is not written, if that was tried."""
        unread = self._read[1] if "_read" in vars(self) else ()
        return *unread, *(self.as_gltf[1] if "as_gltf" in vars(self) else ())

    @cached_property
    def as_gltf(self) -> tuple[Gltf, tuple[str, ...]]:
        """The character of an FBX file as glTF, and what is left out, a line each; errors as in `gltf_character`."""
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

    character: Character  # which nodes they are
    mesh: CharacterMesh
    face: Face | None = None  # its expressions; None for FBX

    @property
    def warnings(self) -> tuple[str, ...]:
        """What of the file is not kept or not read, a line each."""
        return *self.character.warnings, *self.mesh.warnings


@dataclass(frozen=True, eq=False)
class TargetFile:
    """The target in a file, the file's path for errors, and the file itself; workers do without it."""

    target: LoadedTarget
    path: str | Path
    file: InputFile | None

    @classmethod
    def of(cls, file: InputFile) -> TargetFile:
        """Return the target in a file; errors as in `load_target`."""
        return cls(parse_target(file), file.path, file)


def load_target(path: Source) -> LoadedTarget:
    """Return the target in a skeleton file (full or short form), a BVH file, or the file of a character: glTF 2.0
    (.glb, .gltf), VRM 0 or 1, FBX; or in its bytes, or a file object opened as binary. The content decides which it is.

    `retarget` takes the result as it is; its method `for_source` gives the whole skeleton for a source.

    Raises:
        FileError: the file cannot be read, or has no character.
        SkeletonFileError, BvhError: it breaks its format, or is no BVH file; or no bone of the body has a length.
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
    """Return the target in a file of a whole skeleton, or a SkeletonFileError; other errors as in `parse_target`."""
    target = parse_target(file)
    if isinstance(target, SkeletonEdit):
        raise SkeletonFileError(file.path, "", 'has no "joints"; this short form needs a source to change')
    return target


def load_build(path: str | Path) -> Build:
    """Return the build of the body in a file: a character whose mesh shows it (GLB, glTF, VRM, FBX), or a skeleton file
    with radii; or an average build by its name: "adult", "child", "baby", "old", "thin", "fat" or "muscular". Any body
    that is recognised can have it.

    Raises:
        FileError: the file cannot be read, shows no thickness, or no human body is recognised in it; or no average
            build has this name.
        SkeletonFileError, BvhError: it is not valid.
        SettingsError: `path` is neither a path nor a name.
    """
    check_path("path", path)
    if str(path) in BUILDS:
        return average_build(str(path))
    if not Path(path).suffix and not Path(path).exists():
        raise FileError(path, f"is neither a file nor an average build ({', '.join(BUILDS)})")
    return parse_build(load_file(path))


def parse_build(file: InputFile) -> Build:
    """Return the build of the body in a file as `load_build` does."""
    return build_of(parse_full_target(file), file.path)


def build_of(target: Target, path: str | Path) -> Build:
    """Return the build of a target's body; a FileError that names a path if it shows none."""
    body, mesh = Body.of(target.skeleton, target.motion), target.mesh()
    if body.anatomy is None:
        raise FileError(path, "shows no human body, so that another body cannot be as thick as it")
    if mesh is None and not target.radii:
        raise FileError(path, "does not show how thick its body is; expected a GLB, VRM or FBX with a mesh")
    return Build.of(body, capsules_of(body, mesh, target.radii), mesh and bare_mesh(body, mesh))


def with_source(builds: Builds, file: InputFile) -> Builds:
    """Return the builds with that of the source, whose motion is in this file, where its mesh shows it."""
    if builds.source is not None or not file.format.has_characters:
        return builds
    with suppress(DistretargetError):
        return replace(builds, source=parse_build(file))
    return builds
