"""The target skeletons of four conventions: plausible bodies."""

import re

import numpy as np
import pytest
from sample_rigs import CONVENTIONS, POSES, RIGS, rig

from distretarget.body.body import Body

JOINTS = {"mixamo": 65, "xsens": 23, "lafan1": 22, "unreal": 68}
UPPER_ARM = {"mixamo": "mixamorig:LeftArm", "xsens": "LeftShoulder", "lafan1": "LeftArm", "unreal": "upperarm_l"}
FOREARM = {"mixamo": "mixamorig:LeftForeArm", "xsens": "LeftElbow", "lafan1": "LeftForeArm", "unreal": "lowerarm_l"}
HAND = {"mixamo": "mixamorig:LeftHand", "xsens": "LeftWrist", "lafan1": "LeftHand", "unreal": "hand_l"}
SIDE = re.compile(r"Left|Right|_[lr](?=_|$)")
OTHER = {"Left": "Right", "Right": "Left", "_l": "_r", "_r": "_l"}

conventions = pytest.mark.parametrize("convention", CONVENTIONS)
poses = pytest.mark.parametrize("pose", POSES)


def standing(skeleton):
    """Positions of the joints in the rest pose, by name: Y up, facing +Z, the left side at +X."""
    points = skeleton.rest_positions + skeleton.offsets[0]
    if skeleton.up == "Z":
        points = points[:, [0, 2, 1]] * (1, 1, -1)
    return dict(zip(skeleton.names, points, strict=True))


def feet(skeleton):
    """The ankles and toes of both legs, by name."""
    return [[skeleton.names[joint] for joint in (leg.ankle, leg.toe)] for leg in Body.of(skeleton).legs]


def test_every_rig_is_tested():
    assert len([*RIGS.iterdir()]) == len(CONVENTIONS) * len(POSES)


@conventions
@poses
def test_a_rig_has_units_and_an_up_axis(convention, pose):
    skeleton = rig(convention, pose)
    assert (skeleton.units, skeleton.up) == ("cm", "Z" if convention == "unreal" else "Y")


@conventions
@poses
def test_all_joints_are_there_and_every_bone_has_a_length(convention, pose):
    skeleton = rig(convention, pose)
    assert np.sum(~skeleton.end_sites) == JOINTS[convention]
    short = [skeleton.names[joint] for joint in np.flatnonzero(skeleton.lengths[1:] < 0.4) + 1]
    assert all(name.startswith("ik_") for name in short)


@conventions
@poses
def test_left_and_right_are_mirror_images(convention, pose):
    places = standing(rig(convention, pose))
    for name, place in places.items():
        twin = SIDE.sub(lambda side: OTHER[side.group()], name)
        if name != "ik_hand_gun":
            np.testing.assert_allclose(places[twin], place * (-1, 1, 1), atol=1e-5)
        if "Left" in name or name.endswith("_l"):
            assert place[0] > 0


@conventions
@pytest.mark.parametrize(("pose", "angle"), [("T", 0), ("A", 45)])
def test_arms_are_straight_and_point_sideways_or_down(convention, pose, angle):
    places = standing(rig(convention, pose))
    upper, fore, hand = (places[names[convention]] for names in (UPPER_ARM, FOREARM, HAND))
    expected = np.array([np.cos(np.radians(angle)), -np.sin(np.radians(angle)), 0])
    for bone in (fore - upper, hand - fore):
        np.testing.assert_allclose(bone / np.linalg.norm(bone), expected, atol=1e-6)


@conventions
def test_the_poses_differ_below_the_upper_arms_only_and_not_in_lengths(convention):
    sideways, down = rig(convention, "T"), rig(convention, "A")
    body = ~np.char.startswith(sideways.names, "ik_")
    np.testing.assert_allclose(sideways.lengths[body], down.lengths[body], atol=1e-5)
    turned = np.abs(sideways.offsets - down.offsets).max(axis=1) > 1e-5
    arms = [name for name, below in zip(sideways.names, turned & body, strict=True) if below]
    assert arms
    assert all(re.search("arm|hand|elbow|wrist|thumb|index|middle|ring|pinky", name, re.IGNORECASE) for name in arms)


@conventions
@poses
def test_it_stands_on_the_floor_as_tall_as_an_adult(convention, pose):
    skeleton = rig(convention, pose)
    places = standing(skeleton)
    heights = np.array([place[1] for place in places.values()])
    assert 160 < heights.max() < 190
    (ankle, toe), (other_ankle, other_toe) = feet(skeleton)
    for one, other in ((ankle, other_ankle), (toe, other_toe)):
        assert places[one][1] == pytest.approx(places[other][1])
    assert 7 < places[ankle][1] < 9
    assert 1 < places[toe][1] < 4
    ahead = places[toe] - places[ankle]
    assert ahead[2] > 4 * abs(ahead[0])
    assert ahead[2] > 2 * -ahead[1] > 0


def test_the_bodies_differ():
    bodies = [Body.of(rig(convention, "T")) for convention in CONVENTIONS]
    assert len({round(body.height, 1) for body in bodies}) == len(bodies)
    assert len({round(body.leg_length, 1) for body in bodies}) == len(bodies)


def test_handles_are_where_the_joints_are():
    places = standing(rig("unreal", "A"))
    for handle, joint in (("ik_hand_gun", "hand_r"), ("ik_hand_l", "hand_l"), ("ik_foot_r", "foot_r")):
        np.testing.assert_allclose(places[handle], places[joint], atol=1e-5)


def test_bones_lie_along_x_as_in_lafan1():
    skeleton, standing_one = rig("lafan1", "X"), rig("lafan1", "T")
    np.testing.assert_allclose(skeleton.lengths, standing_one.lengths, atol=1e-5)
    for joint in range(1, len(skeleton)):
        alone = len(skeleton.children[skeleton.parents[joint]]) == 1
        assert not alone or tuple(skeleton.offsets[joint, 1:]) == (0, 0)
    thighs = skeleton.offsets[[skeleton.index("LeftUpLeg"), skeleton.index("RightUpLeg")]]
    np.testing.assert_allclose(thighs[0], thighs[1] * (1, 1, -1))
    assert thighs[0, 2] > 5
    with pytest.raises(ValueError, match="only lafan1 has pose X, not mixamo"):
        rig("mixamo", "X")
