"""Figures of blocks, with one bone for each arm and leg, in the disguises in which packs have them."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import SAMPLES, person
from characters import ARMATURE, Bones, Mesh, character
from fbx_text import FPS_30, Z_UP, MeshOfNodes, Node, fbx
from program import succeeded
from scipy.spatial.transform import Rotation

from distretarget import Contact, ContactList, load_target, read_motion, retarget, write_motion
from distretarget.body.body import Body
from distretarget.matching.unmatched import parts_without_source

PARENTS = np.array([-1, 0, 1, 1, 1, 0, 0])
PLACES = np.array(
    [[0, 0.7, 0], [0, 0.7, 0], [0, 1.4, 0], [0.3, 1.3, 0], [-0.3, 1.3, 0], [0.12, 0.7, 0], [-0.12, 0.7, 0]]
)
TRUNK = [[-0.25, 0.7, -0.1], [0.25, 1.4, 0.1]], [[-0.2, 1.4, -0.2], [0.2, 1.8, 0.2]]
HANGING = [[0.25, 0.7, -0.1], [0.45, 1.4, 0.1]], [[-0.45, 0.7, -0.1], [-0.25, 1.4, 0.1]]
T_POSE = [[0.25, 1.2, -0.1], [0.95, 1.4, 0.1]], [[-0.95, 1.2, -0.1], [-0.25, 1.4, 0.1]]
LEGS = [[0.02, 0, -0.1], [0.22, 0.7, 0.1]], [[-0.22, 0, -0.1], [-0.02, 0.7, 0.1]]
BOX = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
SQUARES = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
FACES = SQUARES[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
SIDES = ("left", "right")
LENGTH = 0.7  # of a leg [m]
WALK = SAMPLES / "walk.bvh"


def blocks(arms):
    """The corners of a box for each joint but the root, and their joints."""
    boxes = np.array([*TRUNK, *arms, *LEGS], float)
    corners = boxes[:, None, 0] + BOX * (boxes[:, 1] - boxes[:, 0])[:, None]
    return corners.reshape(-1, 3), np.repeat(np.arange(1, 7), len(BOX))


def triangles():
    return np.concatenate([FACES + len(BOX) * number for number in range(6)])


def glb(path, names, arms, axes=None, above=None):
    points, joints = blocks(arms)
    weights = np.tile([1.0, 0, 0, 0], (len(points), 1))
    mesh = Mesh(points, triangles(), joints[:, None] * (weights > 0), weights)
    return character(Bones(tuple(names), PARENTS, PLACES), axes=axes, above=above, meshes=[mesh]).write(path)


def kenney(folder):
    names = ("root", "torso", "head", "arm-left", "arm-right", "leg-left", "leg-right")
    return glb(folder / "kenney.glb", names, HANGING)


def blender(folder):
    """In T-pose, in centimetres with Z up, and with axes of bones that point anywhere."""
    names = ("Hips", "Body", "Head", "Arm.L", "Arm.R", "Leg.L", "Leg.R")
    axes = Rotation.from_rotvec(np.arange(7)[:, None] * [0.4, 0.9, -0.3])
    return glb(folder / "blender.glb", names, T_POSE, axes, ARMATURE)


def facing_back(folder):
    """Of a game of blocks: it looks to -Z, and every part hangs from the root."""
    names = ("root", "body", "head", "left_arm", "right_arm", "left_leg", "right_leg")
    points, joints = blocks(HANGING)
    turn = np.array([-1.0, 1.0, -1.0])
    weights = np.tile([1.0, 0, 0, 0], (len(points), 1))
    mesh = Mesh(points * turn, triangles(), joints[:, None] * (weights > 0), weights)
    bones = Bones(names, np.array([-1, 0, 0, 0, 0, 0, 0]), PLACES * turn)
    return character(bones, meshes=[mesh]).write(folder / "game.glb")


def roblox(folder):
    """FBX in centimetres with Z up; the trunk is the root."""
    pytest.importorskip("ufbx")
    names = ("Torso", "Head", "Left Arm", "Right Arm", "Left Leg", "Right Leg")
    z_up = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    places = 100.0 * PLACES[1:] @ z_up
    nodes = [
        Node(name, 0 if number else -1, T=tuple(place - (places[0] if number else 0.0)))
        for number, (name, place) in enumerate(zip(names, places, strict=True))
    ]
    binds = {number: np.block([[np.eye(3), place[:, None]], [np.zeros(3), 1.0]]) for number, place in enumerate(places)}
    points, joints = blocks(HANGING)
    flat, uv = np.tile([0.0, 0.0, 1.0], (6 * len(FACES), 3, 1)), np.zeros((6 * len(FACES), 3, 2))
    mesh = MeshOfNodes(binds, 100.0 * points @ z_up, joints - 1, triangles(), flat, uv)
    path = folder / "roblox.fbx"
    path.write_bytes(fbx(nodes, mesh=mesh, settings={"UnitScaleFactor": 1.0, **Z_UP, **FPS_30}))
    return path


DISGUISES = pytest.mark.parametrize("disguise", [kenney, blender, facing_back, roblox], ids=lambda each: each.__name__)


def lowest_of_legs(result, target):
    """(frames, 2), the height of the lowest point of each leg [lengths of a leg]."""
    body, mesh = result.matching.target, target.mesh()
    legs = [mesh.carriers == leg.hip for leg in body.legs]
    heights = [mesh.posed(result.motion[[frame]])[0] @ body.up_vector for frame in range(len(result.motion))]
    return np.array([[of_frame[leg].min() for leg in legs] for of_frame in heights]) / body.leg_length


def directions(motion, top, end):
    bones = motion.positions[:, end] - motion.positions[:, top]
    return bones / np.linalg.norm(bones, axis=1, keepdims=True)


@DISGUISES
def test_limbs_of_one_bone_have_ends_where_their_skin_has(disguise, tmp_path):
    target = load_target(disguise(tmp_path))
    body = Body.of(target.skeleton)
    scale = 100.0 if target.skeleton.units == "cm" else 1.0
    for side in SIDES:
        assert f"{side}LowerLeg" not in body.roles
        assert f"{side}LowerArm" not in body.roles
        arm = target.skeleton.lengths[body.roles[f"{side}Hand"]]
        assert arm == pytest.approx((0.65 if disguise is blender else 0.6) * scale, rel=1e-4)
    assert body.leg_length == pytest.approx(LENGTH * scale, rel=1e-4)


@DISGUISES
def test_a_figure_of_blocks_walks_on_its_soles(disguise, tmp_path):
    target = load_target(disguise(tmp_path))
    result = retarget(read_motion(WALK), target)
    heights = lowest_of_legs(result, target).min(axis=1)
    assert np.abs(heights).max() < 0.03
    assert np.abs(np.median(heights)) < 0.005
    assert "Check" not in result.verdict
    assert next(parts_without_source(result.matching)).startswith("arms and legs of the target are one bone each")


def test_without_a_mesh_legs_stand_on_their_ends(tmp_path):
    skeleton = replace(load_target(kenney(tmp_path)).skeleton, floor_at_zero=False)
    result = retarget(read_motion(WALK), skeleton)
    ankles = [leg.ankle for leg in result.matching.target.legs]
    lowest = result.motion.positions[:, ankles, 1].min(axis=1) / LENGTH
    assert np.abs(lowest).max() < 0.07


@DISGUISES
def test_arms_point_from_the_shoulders_to_the_hands_of_the_source(disguise, tmp_path):
    source, target = read_motion(SAMPLES / "clap.bvh"), load_target(disguise(tmp_path))
    result = retarget(source, target)
    body, original = result.matching.target, Body.of_motion(result.world.turned(source))
    for side in SIDES:
        ends = [[each.roles[f"{side}{part}"] for part in ("UpperArm", "Hand")] for each in (body, original)]
        own, wanted = directions(result.motion, *ends[0]), directions(original.motion, *ends[1])
        assert (own * wanted).sum(axis=1).min() > np.cos(np.radians(3))


def test_who_sits_stays_down_and_has_legs_on_the_floor(tmp_path):
    target = load_target(kenney(tmp_path))
    source = read_motion(SAMPLES / "supports" / "sit.bvh")
    result = retarget(source, target)
    hips = [leg.hip for leg in result.matching.target.legs]
    heights = result.motion.positions[:, hips, 1].mean(axis=1) / LENGTH
    assert heights[:10].min() > 0.95
    assert heights.min() < 0.35
    assert lowest_of_legs(result, target).min() > -0.1


@DISGUISES
def test_what_is_written_is_read_back_and_moves_a_person(disguise, tmp_path):
    path, out = disguise(tmp_path), tmp_path / "out.glb"
    result = retarget(read_motion(WALK), load_target(path))
    write_motion(out, result, path)
    back = read_motion(out)
    assert len(back.skeleton) == len(result.motion.skeleton)
    scale = np.ptp(back.positions[0], axis=0).max() / np.ptp(result.motion.positions[0], axis=0).max()
    own = np.linalg.norm(np.diff(result.motion.positions, axis=1), axis=2)
    np.testing.assert_allclose(np.linalg.norm(np.diff(back.positions, axis=1), axis=2), scale * own, atol=1e-4)
    moved = retarget(back, person())
    straight = [moved.matching.target.roles[f"left{part}"] for part in ("UpperLeg", "LowerLeg", "Foot")]
    thigh, shin = (directions(moved.motion, *straight[k : k + 2]) for k in range(2))
    assert moved.verdict
    assert (thigh * shin).sum(axis=1).min() > np.cos(np.radians(40))


def test_clips_are_merged_into_the_file_of_a_figure_of_blocks(tmp_path):
    path, out = kenney(tmp_path), tmp_path / "all.glb"
    clips = [SAMPLES / f"{name}.bvh" for name in ("clap", "wave")]
    succeeded("batch", *clips, path, "-o", out, "--merge")
    result = retarget(read_motion(clips[1]), load_target(path))
    np.testing.assert_allclose(read_motion(out, "wave").positions, result.motion.positions, atol=1e-4)


def test_arms_that_cannot_bend_may_have_contacts(tmp_path):
    entry = Contact(between=("left upper arm", "right upper arm"), gap=15.0, frames=(10, 40))
    result = retarget(read_motion(WALK)[:50], load_target(kenney(tmp_path)), contacts=ContactList((entry,)))
    assert np.isfinite(result.motion.positions).all()
    names = ("root", "torso", "head", "arm-left", "arm-right", "x-left", "x-right", "leg-left", "leg-right")
    places = np.vstack([PLACES, PLACES[5:] - [0.0, 0.1, 0.0]])
    path = character(Bones(names, np.append(PARENTS, [5, 6]), places)).write(tmp_path / "odd.glb")
    anatomy = Body.of(load_target(path).skeleton).anatomy
    assert anatomy is None or "leftUpperLeg" not in anatomy.roles
