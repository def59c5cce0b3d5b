"""A BVH that Blender turns into FBX is the same performance: its joints are where the BVH has them."""

import os
import subprocess

import numpy as np
import pytest
from bodies import SAMPLES

from distretarget import read_bvh, read_motion
from interop.players import missing
from interop.readers import BLENDER

MAKE = """
import sys, bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_anim.bvh(filepath=sys.argv[1], global_scale=0.01, update_scene_fps=True, update_scene_duration=True)
bpy.ops.export_scene.fbx(filepath=sys.argv[2], add_leaf_bones=False, bake_anim_simplify_factor=0)
"""
NEAR = 1e-4  # [m]


@pytest.mark.parametrize("clip", ["walk", "clap", "supports/cartwheel"])
def test_joints_of_fbx_are_those_of_bvh(clip, tmp_path):
    pytest.importorskip("ufbx")
    if reason := missing("Blender"):
        pytest.skip(reason)
    source, out = SAMPLES / f"{clip}.bvh", tmp_path / "clip.fbx"
    subprocess.run([os.environ[BLENDER], "-c", MAKE, source, out], capture_output=True, check=True)
    bvh, fbx = read_bvh(source), read_motion(out)
    assert len(fbx) == len(bvh)
    metres = 0.01 if fbx.skeleton.units == "cm" else 1.0
    joints = [joint for joint in bvh.skeleton.joints if bvh.skeleton.names[joint] in fbx.skeleton.names]
    found = metres * fbx.positions[:, [fbx.skeleton.names.index(bvh.skeleton.names[joint]) for joint in joints]]
    expected = 0.01 * bvh.positions[:, joints]
    worst = float(np.linalg.norm(found - expected, axis=2).max())
    print(f"{clip}: {1000 * worst:.4f} mm over {len(joints)} joints")
    assert len(joints) == len(bvh.skeleton.joints)
    assert worst < NEAR
