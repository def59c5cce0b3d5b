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


def main() -> None:
    """Retarget and save; a fault is one line and exit code 1."""
    asked = _asked()
    if asked.character.suffix != ".blend" or not asked.character.is_file():
        _fail(f"{asked.character}: expected a .blend file; GLB and VRM need no Blender: distretarget CLIP HERO.glb")
    if asked.out.suffix != ".blend" or asked.out.exists():
        _fail(f"{asked.out}: expected the name of a new .blend file")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(asked.character.resolve()), load_ui=False)
        _register()
        bpy.context.view_layer.objects.active = _armature(asked.armature)
        settings, clip = bpy.context.scene.distretarget, str(asked.clip.resolve())
        for name in ("keys", "start", "animation", "push_down", "as_assets"):
            setattr(settings, name, getattr(asked, name))
        if asked.clip.is_dir():
            settings.folder = clip
            bpy.ops.distretarget.retarget_folder()
        else:
            settings.clip = clip
            if asked.contacts:
                bpy.ops.distretarget.contacts_import(filepath=str(asked.contacts))
            bpy.ops.distretarget.retarget()
        bpy.ops.wm.save_as_mainfile(filepath=str(asked.out.resolve()))
    except RuntimeError as error:
        _fail(str(error).strip().splitlines()[0].removeprefix("Error: "))
    for line in (settings.verdict, *(each.text for each in settings.warnings)):
        print(line)


def _asked() -> argparse.Namespace:
    """The arguments after `--`, or all of them where there is none."""
    parser = argparse.ArgumentParser(prog="blender --background --python command.py --")
    parser.add_argument("character", type=Path, metavar="HERO.blend")
    parser.add_argument("clip", type=Path, metavar="CLIP", help="BVH, FBX, GLB, VRMA or npz, or a folder of them")
    parser.add_argument("out", type=Path, metavar="OUT.blend")
    parser.add_argument("--armature", metavar="NAME", help="where the file has several")
    parser.add_argument("--keys", choices=("JOINTS", "FK", "IK"), default="JOINTS", help="which bones get the keys")
    parser.add_argument("--start", type=int, default=1, help="the frame at which the action begins")
    parser.add_argument("--animation", default="", metavar="NAME", help="where the clip's file has several")
    parser.add_argument("--contacts", type=Path, metavar="FILE", help="a contact file")
    parser.add_argument("--push-down", action="store_true", help="an NLA track for each clip of a folder")
    parser.add_argument("--as-assets", action="store_true", help="mark the actions of a folder as assets")
    return parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)


def _fail(message: str) -> None:
    sys.exit(f"Error: {message}")


def _register() -> None:
    """Register the extension, unless Blender's preferences have enabled it."""
    if not hasattr(bpy.types.Scene, "distretarget"):
        here = Path(__file__).resolve().parent
        sys.path.insert(0, str(here.parent))
        extension = importlib.import_module(here.name)
        extension.register()
        atexit.register(extension.unregister)  # Python would hang as it ends


def _armature(name: str | None) -> bpy.types.Object:
    """The armature with a name, else the only one with meshes, else the only one."""
    objects = bpy.context.view_layer.objects
    all_ = [each for each in objects if each.type == "ARMATURE" and name in (None, each.name)]
    moving = [each for each in all_ if any(mesh.find_armature() == each for mesh in objects if mesh.type == "MESH")]
    found = moving or all_
    if len(found) != 1:
        names = ", ".join(repr(each.name) for each in objects if each.type == "ARMATURE") or "none"
        _fail(f"expected one armature{f' {name!r}' if name else '; choose with --armature'}, found {names}")
    return found[0]


if __name__ == "__main__":
    main()
