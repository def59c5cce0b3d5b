"""The armature of a .blend file, the skeleton that its meshes need, and what else moves its bones."""

import argparse
import sys
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import NoReturn

import bpy

sys.path.append(str(Path(__file__).resolve().parents[2] / "blender"))  # the modules of the extension
from rig import SAME, constraints_on, drivers_on, moved_bones, skinned_meshes

SHOWN = 6  # names that a message lists


def parse_arguments(usage: str, *files: str) -> argparse.Namespace:
    """Parse the arguments after `--`, or all of them where there is none: some files, and `--armature`."""
    parser = argparse.ArgumentParser(usage=usage)
    for name in files:
        parser.add_argument(name, type=Path)
    parser.add_argument("--armature", metavar="NAME", help="the armature, where a file has several")
    return parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)


def fail(message: str) -> NoReturn:
    """End with one line and exit code 1."""
    raise SystemExit(f"Error: {message}")


def warn(message: str) -> None:
    """Print one line about what the user may not expect."""
    print(f"Warning: {message}", file=sys.stderr)


def listed(names: Iterable[str]) -> str:
    """The first names, and how many more there are."""
    names = list(dict.fromkeys(names))
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(map(repr, names[:SHOWN])) + more


def open_character(path: Path, name: str | None) -> bpy.types.Object:
    """Open a .blend file; return the armature `name`, else the only one with a skinned mesh, else the only one."""
    if path.suffix.lower() != ".blend":
        fail(f"{path}: expected a .blend file; for GLB and VRM run distretarget WALK.bvh HERO.glb -o HERO_WALK.glb")
    if not path.is_file():
        fail(f"{path}: no such file")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    except RuntimeError as error:
        fail(f"{path}: {str(error).strip().splitlines()[-1]}")
    armatures = [each for each in bpy.context.scene.objects if each.type == "ARMATURE"]
    if name is not None:
        found = [each for each in armatures if each.name == name]
    else:
        found = [each for each in armatures if skinned_meshes(each)] or armatures
    if len(found) != 1:
        wanted = "which armature? Give one as --armature" if name is None and found else f"no armature {name or ''}"
        there = listed(each.name for each in armatures) or "none"
        fail(f"{path}: {wanted.strip()}; scene {bpy.context.scene.name!r} has {there}")
    if not found[0].data.bones:
        fail(f"{path}: {found[0].name!r} has no bones")
    return found[0]


def warn_of_rig(armature: bpy.types.Object, joints: Collection[str]) -> None:
    """Name what else would move the bones of joints, and what becomes of it."""
    moved = moved_bones(armature, joints)
    constrained = [bone.name for bone, _ in constraints_on(armature, moved)]
    if constrained:
        warn(f"apply_motion.py mutes the constraints of {listed(constrained)}: they would move bones of the motion")
    driven = [bone.name for bone, _ in drivers_on(armature, moved)]
    if driven:
        warn(f"apply_motion.py mutes the drivers of {listed(driven)}: they would move bones of the motion")
    alone = [bone.name for bone in moved if not bone.bone.use_inherit_rotation]
    if alone:
        warn(f"these bones do not inherit rotation, their keys hold all of it: {listed(alone)}")
    sizes = armature.matrix_world.to_scale()
    if min(sizes) <= 0 or max(sizes) > (1 + SAME) * min(sizes):
        warn(f"{armature.name!r} has the scale {tuple(round(size, 4) for size in sizes)}: apply it with Ctrl+A")
