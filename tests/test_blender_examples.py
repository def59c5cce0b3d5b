"""The scripts for Blender: the skeleton of a character becomes a target, and the character takes on the result.

They need the package bpy, here or in the Python that DISTRETARGET_BLENDER names.
"""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from bodies import SAMPLES
from scipy.spatial.transform import Rotation

from distretarget import load_target, read_bvh, retarget, write_bvh

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = ROOT / "examples" / "blender"
CLIP = read_bvh(SAMPLES / "clap.bvh")[100:200:8]
BLENDER = os.environ.get("DISTRETARGET_BLENDER") or (sys.executable if importlib.util.find_spec("bpy") else None)

pytestmark = pytest.mark.skipif(BLENDER is None, reason="Blender's module bpy is not installed")

# The heads and rotations from the rest pose of the bones of an armature in each frame, in the world.
LOOK = """
import json, sys, bpy
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
armature, scene = bpy.data.objects[sys.argv[2]], bpy.context.scene
poses = []
for frame in range(scene.frame_start, scene.frame_end + 1):
    scene.frame_set(frame)
    shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
    world = shown.matrix_world
    pose = {}
    for bone in shown.pose.bones:
        turn = world @ bone.matrix @ (world @ bone.bone.matrix_local).inverted()
        pose[bone.name] = [*map(list, turn.to_3x3()), list(world @ bone.head)]
    poses.append(pose)
print("poses:" + json.dumps({"poses": poses, "seconds": scene.render.fps_base / scene.render.fps}))
"""


def blender(*arguments, code=0):
    """What Blender prints, in both streams."""
    done = subprocess.run([BLENDER, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == code, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def characters(tmp_path_factory):
    """A folder of odd characters."""
    folder = tmp_path_factory.mktemp("characters")
    names = ["names_with_spaces", "odd_names", "scale_001", "scale_uneven", "ik", "no_inherited_rotation", "drivers"]
    more = ["constraints", "hidden", "two_armatures", "two_characters", "two_roots", "meshes_on_bones", "posed"]
    blender(ROOT / "tests" / "odd_characters.py", folder, *names, *more)
    return folder


def exported(hero, folder, *options):
    """The target that the script makes of a character, and what it prints."""
    target = folder / "hero.json"
    printed = blender(SCRIPTS / "export_target.py", "--", hero, target, *options)
    return load_target(target), printed


def applied(hero, motion, folder, *options, code=0):
    """The character with a motion, and what the script prints."""
    clip, out = folder / "moved.bvh", folder / "out.blend"
    write_bvh(clip, motion, overwrite=True)
    return out, blender(SCRIPTS / "apply_motion.py", "--", hero, clip, out, *options, code=code)


def poses(path, armature, motion):
    """Heads and rotations of the bones of an armature as in a motion: (frames, joints, 3), and a Rotation of each."""
    printed = blender("-c", LOOK, path, armature)
    found = json.loads(next(line for line in printed.splitlines() if line.startswith("poses:"))[6:])
    assert found["seconds"] == pytest.approx(motion.frame_time, rel=1e-6)
    matrices = np.array([[pose[name] for name in motion.skeleton.names] for pose in found["poses"]])
    return matrices[:, :, 3], Rotation.from_matrix(matrices[:, :, :3].reshape(-1, 3, 3))


@pytest.mark.parametrize(
    ("name", "armature", "options", "said"),
    [
        ("names_with_spaces", "Armature", (), ""),
        ("odd_names", "Armature", (), ""),
        ("scale_001", "Armature", (), ""),
        ("ik", "Armature", (), "the constraints of 'forearm.L', 'forearm.R', 'shin.L', 'shin.R'"),
        ("constraints", "Armature", (), "the constraints of 'hand.L', 'foot.L', 'toe.L'"),
        ("hidden", "Armature", (), ""),
        ("no_inherited_rotation", "Armature", (), "do not inherit rotation"),
        ("drivers", "Armature", (), "the drivers of 'forearm.L'"),
        ("two_armatures", "Armature", (), ""),
        ("two_characters", "Armature 2", ("--armature", "Armature 2"), ""),
        ("meshes_on_bones", "Armature", (), ""),
        ("posed", "Armature", (), ""),
    ],
)
def test_a_character_takes_on_a_motion(characters, tmp_path, name, armature, options, said):
    hero = characters / f"{name}.blend"
    target, printed = exported(hero, tmp_path, *options)
    assert said in printed
    assert ("Warning" in printed) == bool(said)
    arrays = np.load(characters / (f"{name}.npz" if armature == "Armature" else f"{name}.{armature}.npz"))
    rest = dict(zip(arrays["names"], arrays["rest"][:, [0, 2, 1]] * (1, -1, 1), strict=True))
    skeleton = target.skeleton
    assert set(skeleton.names) == set(rest) - {"hand_ik.L", "hand_ik.R", "foot_ik.L", "foot_ik.R"}
    assert not skeleton.end_sites.any()
    for joint in range(1, len(skeleton)):
        joints = [skeleton.names[each] for each in (joint, skeleton.parents[joint])]
        np.testing.assert_allclose(skeleton.offsets[joint], rest[joints[0]] - rest[joints[1]], atol=1e-6)

    motion = retarget(CLIP, target).motion
    out, printed = applied(hero, motion, tmp_path, *options)
    assert said in printed
    places, turns = poses(out, armature, motion)
    np.testing.assert_allclose(places, motion.positions, atol=2e-5)
    assert (turns * Rotation.from_quat(motion.world_rotations.reshape(-1, 4)).inv()).magnitude().max() < 1e-4


def test_bones_without_a_common_root_hang_from_the_armature(characters, tmp_path):
    hero = characters / "two_roots.blend"
    target, _ = exported(hero, tmp_path)
    skeleton = target.skeleton
    assert skeleton.names[0] == "Armature"
    assert skeleton.parents[[skeleton.index("spine"), skeleton.index("lantern")]].tolist() == [0, 0]
    motion = retarget(CLIP, target).motion
    assert "25 bones" in applied(hero, motion, tmp_path)[1]


def test_a_rigify_rig_moves_by_its_deforming_bones(tmp_path):
    blender(ROOT / "tests" / "odd_characters.py", tmp_path, "rigify")
    hero = tmp_path / "rigify.blend"
    target, printed = exported(hero, tmp_path)
    assert "175 joints of the 706 bones of 'rig'" in printed
    skeleton = target.skeleton
    parents = {name: skeleton.names[parent] for name, parent in zip(skeleton.names, skeleton.parents, strict=True)}
    assert parents["DEF-spine"] == "root"
    assert parents["DEF-thigh.L"] == "DEF-spine"
    assert parents["DEF-upper_arm.R"] == "DEF-shoulder.R"
    assert parents["DEF-shoulder.R"] == "DEF-spine.003"
    result = retarget(CLIP, target)
    out, printed = applied(hero, result.motion, tmp_path)
    assert "mutes the constraints of 'DEF-spine'" in printed
    places, _ = poses(out, "rig", result.motion)
    np.testing.assert_allclose(places, result.motion.positions, atol=5e-5)
    hand = skeleton.index("DEF-hand.L")
    assert np.linalg.norm(np.ptp(places[:, hand] - places[:, skeleton.index("DEF-spine.003")], axis=0)) > 0.05


def test_what_ends_with_one_line(characters, tmp_path):
    hero, clip, out = characters / "two_armatures.blend", tmp_path / "clip.bvh", tmp_path / "out.blend"
    export, apply = SCRIPTS / "export_target.py", SCRIPTS / "apply_motion.py"
    write_bvh(clip, CLIP)

    def said(*arguments):
        """The error of a run that fails, which is one line."""
        (line,) = [line for line in blender(*arguments, code=1).splitlines() if line.startswith("Error:")]
        assert not out.exists()
        return line

    both = characters / "two_characters.blend"
    assert "which armature? Give one as --armature; scene 'Scene' has 'Armature', 'Armature 2'" in said(
        export, both, clip
    )
    assert "no armature Hero; scene 'Scene' has 'Armature'" in said(export, hero, clip, "--armature", "Hero")
    assert "expected a .blend file" in said(export, "--", "hero.glb", clip)
    assert "none.blend" in said(export, "--", tmp_path / "none.blend", clip)
    assert "none.bvh" in said(apply, "--", hero, tmp_path / "none.bvh", out)
    assert "is no BVH file" in said(apply, "--", hero, SCRIPTS / "bvh.py", out)
    assert "22 joints are no bones of 'Armature': 'Hips'" in said(apply, "--", hero, clip, out)
    assert "expected another name" in said(apply, "--", hero, clip, hero)


def test_a_motion_of_another_body_is_refused(characters, tmp_path):
    target, _ = exported(characters / "ik.blend", tmp_path)
    offsets = np.array(target.skeleton.offsets)
    offsets[target.skeleton.index("forearm.L")] *= 1.1
    motion = retarget(CLIP, target.skeleton.with_offsets(offsets)).motion
    out, printed = applied(characters / "ik.blend", motion, tmp_path, code=1)
    assert "'forearm.L' has the offset" in printed
    assert not out.exists()


def test_joints_that_are_off_are_an_error(characters, tmp_path):
    hero = characters / "scale_uneven.blend"
    target, printed = exported(hero, tmp_path)
    assert "'Armature' has the scale (1.0, 1.0, 1.1): apply it" in printed
    _, printed = applied(hero, retarget(CLIP, target).motion, tmp_path, code=1)
    assert "is saved, but joints are up to" in printed
