"""Read targets from files: BVH, characters (glTF, VRM, FBX) with their meshes, skeleton files; and builds of bodies."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from distretarget.body.body import Body
from distretarget.body.build import BUILDS, Build, Builds, average_build, bare_mesh, capsules_of
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
    return parse_build(load_file(path))


def parse_build(file: InputFile) -> Build:
    """Return the build of the body in a file as `load_build` does."""
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
        return replace(builds, source=parse_build(file))
    return builds
