# SPDX-License-Identifier: GPL-3.0-or-later
"""Retarget a clip, or a folder of clips, onto the character in a .blend file, without a window.

blender --background --python command.py -- HERO.blend WALK.bvh HERO_WALK.blend [--keys FK] [--contacts FILE] ...

Also `python command.py HERO.blend ...` where the packages bpy and distretarget are installed. It calls the operators of
the extension's panel. HERO.blend stays as it is.
"""

import argparse
import atexit
import importlib
import sys
from pathlib import Path

import bpy

OPTIONS = ("keys", "start", "animation", "whole_frames", "mirror", "loop", "in_place", "push_down", "as_assets")


def main() -> None:
    """Retarget and save; an error is one line and exit code 1."""
    if not hasattr(bpy.types.Scene, "distretarget"):  # the extension is not enabled in Blender's preferences
        here = Path(__file__).resolve().parent
        sys.path.insert(0, str(here.parent))
        extension = importlib.import_module(here.name)
        extension.register()
        atexit.register(extension.unregister)  # Python would hang at exit otherwise
    given = _arguments()
    if given.character.suffix != ".blend" or not given.character.is_file():
        sys.exit(
            f"Error: {given.character}: expected a .blend file; GLB and VRM need no Blender: distretarget CLIP HERO.glb"
        )
    if given.out.suffix != ".blend" or given.out.exists():
        sys.exit(f"Error: {given.out}: expected the name of a new .blend file")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(given.character.resolve()), load_ui=False)
        bpy.context.view_layer.objects.active = _armature(given.armature)
        settings, clip = bpy.context.scene.distretarget, str(given.clip.resolve())
        for name in OPTIONS:
            setattr(settings, name, getattr(given, name))
        if given.clip.is_dir():
            settings.folder = clip
            bpy.ops.distretarget.retarget_folder()
        else:
            settings.clip = clip
            if given.contacts:
                bpy.ops.distretarget.contacts_import(filepath=str(given.contacts))
            bpy.ops.distretarget.retarget()
        bpy.ops.wm.save_as_mainfile(filepath=str(given.out.resolve()))
    except RuntimeError as error:
        sys.exit(str(error).strip().splitlines()[0])
    for line in (settings.verdict, *(each.name for each in settings.warnings)):
        print(line)


def _arguments() -> argparse.Namespace:
    """The arguments after `--`, or all if there is none; the options are settings of the panel."""
    parser = argparse.ArgumentParser(prog="blender --background --python command.py --")
    parser.add_argument("character", type=Path, metavar="HERO.blend")
    parser.add_argument("clip", type=Path, metavar="CLIP", help="BVH, FBX, GLB, VRMA or npz, or a folder of them")
    parser.add_argument("out", type=Path, metavar="OUT.blend")
    parser.add_argument("--armature", metavar="NAME", help="of the character, if the file has several")
    parser.add_argument("--contacts", type=Path, metavar="FILE", help="a contact file")
    for name in OPTIONS:
        setting = bpy.context.scene.distretarget.bl_rna.properties[name]
        kind = {"BOOLEAN": {"action": "store_true"}, "INT": {"type": int}, "ENUM": {"choices": ("JOINTS", "FK", "IK")}}
        flag = f"--{name.replace('_', '-')}"
        parser.add_argument(flag, default=setting.default, help=setting.description, **kind.get(setting.type, {}))
    return parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)


def _armature(name: str | None) -> bpy.types.Object:
    """The only armature, of this name if given; if there are several, the only one with meshes."""
    objects = bpy.context.view_layer.objects
    armatures = [each for each in objects if each.type == "ARMATURE" and name in (None, each.name)]
    found = [each for each in armatures if any(mesh.find_armature() == each for mesh in objects)] or armatures
    if len(found) != 1:
        names = ", ".join(repr(each.name) for each in objects if each.type == "ARMATURE") or "none"
        sys.exit(f"Error: expected one armature{f' {name!r}' if name else '; choose with --armature'}, found {names}")
    return found[0]


if __name__ == "__main__":
    main()
