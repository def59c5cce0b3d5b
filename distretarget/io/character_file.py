"""Characters in glTF, VRM and FBX files: their nodes, animations and meshes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from distretarget.character.character import Character
from distretarget.character.from_scene import character_of
from distretarget.character.mesh import skinned_mesh
from distretarget.character.nodes import Scene
from distretarget.errors import DistretargetError, SkeletonError
from distretarget.io.fbx import fbx_mesh, parse_fbx
from distretarget.io.gltf_mesh import gltf_materials, gltf_parts
from distretarget.io.gltf_scene import animation_names, gltf_scene
from distretarget.io.input_file import InputFile
from distretarget.skin.mesh import SkinnedMesh

VERTICES = b"Vertices"  # in FBX files with a mesh, binary or text


def read_scene(file: InputFile, clip: str | None = None, fps: float | None = None, animated: bool = True) -> Scene:
    """Return the nodes, skins and an animation of a glTF or FBX file; without it if not `animated`."""
    if file.kind == "FBX":
        return parse_fbx(file.content, file.path, clip, fps, animated)
    return gltf_scene(file.gltf, clip, fps, animated)


def animations_in(file: InputFile) -> tuple[str, ...]:
    """Return the names of the animations in a file, which may be empty or the same; none in other files than these."""
    if file.kind == "FBX":
        return read_scene(file, animated=False).animations
    return animation_names(file.gltf) if file.kind == "glTF" else ()


def parse_character(file: InputFile) -> Character:
    """Return the character in a glTF or FBX file; errors as in `read_motion`."""
    return shown_character(read_scene(file, animated=False))


def shown_character(scene: Scene) -> Character:
    """Return the character of a file's scene; errors as in `read_motion`."""
    try:
        return character_of(scene)
    except SkeletonError as error:
        raise error.in_file(scene.path) from None


@dataclass(frozen=True, eq=False)
class CharacterMesh:
    """The mesh of a character, read from its file when it is first asked for; called, it returns it.

    A file without a mesh, or with one that cannot be read, has none: all else in the file is not to blame.

    Attributes:
        file: the file.
        character: the character in it.
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
        """A line that says why the mesh could not be read, if that was tried."""
        return self._read[1] if "_read" in vars(self) else ()

    @cached_property
    def _read(self) -> tuple[SkinnedMesh | None, tuple[str, ...]]:
        try:
            if self.file.kind == "FBX":
                if VERTICES not in self.file.content:
                    return None, ()
                return skinned_mesh(self.character, *fbx_mesh(self.file.content, self.file.path)), ()
            scene = gltf_scene(self.file.gltf, animated=False)
            parts = tuple(gltf_parts(self.file.gltf, scene.skins))
            return skinned_mesh(self.character, scene.nodes, parts, gltf_materials(self.file.gltf)), ()
        except DistretargetError as error:
            why = error.in_file(self.file.path)
            return None, (f"its mesh is not read, so that the body gets an average thickness: {why}",)
