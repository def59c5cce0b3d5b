"""The mesh of a character's file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from distretarget.character.character import Character
from distretarget.character.mesh import skinned_mesh
from distretarget.errors import DistretargetError
from distretarget.io.fbx import fbx_mesh
from distretarget.io.gltf_materials import gltf_materials
from distretarget.io.gltf_mesh import gltf_parts
from distretarget.io.gltf_scene import gltf_scene
from distretarget.io.input_file import InputFile
from distretarget.skin.mesh import SkinnedMesh

VERTICES = b"Vertices"  # in FBX files with a mesh, binary or text


@dataclass(frozen=True, eq=False)
class HeldMesh:
    """Returns a mesh that was read already; `warnings` are as in `CharacterMesh`."""

    mesh: SkinnedMesh | None
    warnings: tuple[str, ...] = ()

    def __call__(self) -> SkinnedMesh | None:
        return self.mesh


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

    def __reduce__(self) -> tuple[type[HeldMesh], tuple[SkinnedMesh | None, tuple[str, ...]]]:
        """What goes to a worker: the mesh, not the file."""
        return HeldMesh, self._read

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
