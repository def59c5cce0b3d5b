"""The scripts for Blender: the rest pose of a character becomes a target, and the character takes on the result."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from bodies import SAMPLES

from distretarget import load_target, read_bvh, retarget, write_bvh

SCRIPTS = Path(__file__).resolve().parents[1] / "examples" / "blender"
FRAMES = (0, 100, 200)

# A character whose bones are rolled about themselves, from a BVH file.
MAKE = """
import sys, bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_anim.bvh(filepath=sys.argv[1])
armature = bpy.context.object
armature.animation_data_clear()
bpy.ops.object.mode_set(mode="EDIT")
for number, bone in enumerate(armature.data.edit_bones):
    bone.roll += number
bpy.ops.object.mode_set(mode="OBJECT")
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[2])
"""
# Where the heads of the bones are in some frames, in the space of the armature.
LOOK = """
import json, sys, bpy
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
armature = next(each for each in bpy.context.scene.objects if each.type == "ARMATURE")
heads = []
for frame in json.loads(sys.argv[2]):
    bpy.context.scene.frame_set(frame + 1)
    heads.append({bone.name: list(bone.head) for bone in armature.pose.bones})
print("heads:" + json.dumps(heads))
"""


def python(*arguments):
    done = subprocess.run([sys.executable, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_character_in_blender_takes_on_a_retargeted_motion(tmp_path):
    pytest.importorskip("bpy", reason="Blender's module bpy is not installed")
    hero, target, moved, out = (tmp_path / name for name in ("hero.blend", "hero.bvh", "moved.bvh", "out.blend"))
    clip = SAMPLES / "walk.bvh"
    python("-c", MAKE, clip, hero)
    python(SCRIPTS / "export_target.py", "--", hero, target)
    result = retarget(read_bvh(clip), load_target(target))
    write_bvh(moved, result.motion)
    python(SCRIPTS / "apply_motion.py", "--", hero, moved, out)
    printed = python("-c", LOOK, out, json.dumps(FRAMES))
    heads = json.loads(next(line for line in printed.splitlines() if line.startswith("heads:"))[6:])
    skeleton = result.motion.skeleton
    for frame, found in zip(FRAMES, heads, strict=True):
        expected = {name: result.motion.positions[frame, skeleton.index(name)] for name in found}
        for name, head in found.items():
            np.testing.assert_allclose(head, expected[name], atol=0.01, err_msg=name)
