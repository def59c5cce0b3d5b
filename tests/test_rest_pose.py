"""The motion is the same for every rest pose, and no limb is twisted."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from bodies import CORPUS, SAMPLES, lowered, moved, needs_corpus
from scipy.spatial.transform import Rotation
from zoo import CONVENTIONS, rig

from distretarget import read_bvh, retarget
from distretarget.baseline.world import axis_vector
from distretarget.body.body import Body
from distretarget.body.recognition import by_names
from distretarget.io.reading import load_target
from distretarget.numerics.kinematics import make_local
from distretarget.numerics.quaternions import least_rotation

CLIPS = sorted(SAMPLES.glob("*.bvh"))
RECORDED = [
    CORPUS / name
    for name in ("cmu_daz/02_01.bvh", "cmu_mb/05_03.bvh", "makehuman/walk1.bvh", "pybvh/bvh_test3.bvh")
    if CORPUS.is_dir()
]
LIMBS = (("UpperArm", "LowerArm", "Hand"), ("UpperLeg", "LowerLeg", "Foot"))
FREE = "ik_", "root"  # names of joints without a driver begin so: handles, and a root on the floor

conventions = pytest.mark.parametrize("convention", CONVENTIONS)
clips = pytest.mark.parametrize("clip", CLIPS, ids=lambda path: path.stem)


@cache
def read(path, step=3, most=60):
    """Some frames of a clip, from its beginning."""
    motion = read_bvh(path)
    return replace(motion[: step * most : step], frame_time_text=str(step * motion.frame_time))


@cache
def result_on(path, convention, pose):
    return retarget(read(path), rig(convention, pose))


def carried(path, convention, pose):
    return result_on(path, convention, pose).motion


def apart(one, other):
    """The largest distance between joints of two motions [heights], without joints that have no driver."""
    body = [joint for joint, name in enumerate(one.skeleton.names) if not name.startswith(FREE)]
    return np.linalg.norm(one.positions - other.positions, axis=-1)[:, body].max() / Body.of(one.skeleton).height


def bones(motion, limb, side):
    """(frames, 3) per bone of a limb: the joint that turns it, and its direction; the hand goes on as the forearm."""
    anatomy = by_names(motion.skeleton)
    joints = [anatomy.roles[side + part] for part in limb]
    for joint, lower in pairwise(joints):
        bone = motion.positions[:, lower] - motion.positions[:, joint]
        yield joint, bone / np.linalg.norm(bone, axis=1, keepdims=True)
    fore = Rotation.from_quat(motion.world_rotations[:, joints[2]]).apply(
        motion.skeleton.rest_positions[joints[2]] - motion.skeleton.rest_positions[joints[1]]
    )
    yield joints[2], fore / np.linalg.norm(fore, axis=1, keepdims=True)


def rolls_and_directions(one, other):
    """Per bone of arms and legs, by how much its roll and its direction differ between two motions [degrees]; the roll
    is that of a vector that points forward in both rest poses.
    """
    for limb in LIMBS:
        for side in ("left", "right"):
            pairs = zip(bones(one, limb, side), bones(other, limb, side), limb, strict=True)
            for (joint, bone), (other_joint, other_bone), part in pairs:
                ahead = np.eye(3)[2]
                a = Rotation.from_quat(least_rotation(bone, other_bone)) * Rotation.from_quat(
                    one.world_rotations[:, joint]
                )
                b = Rotation.from_quat(other.world_rotations[:, other_joint])
                x, y = (
                    v - (v * other_bone).sum(axis=1, keepdims=True) * other_bone
                    for v in (a.apply(ahead), b.apply(ahead))
                )
                roll = np.degrees(np.arctan2((np.cross(x, y) * other_bone).sum(axis=1), (x * y).sum(axis=1)))
                turn = np.degrees(np.arccos(np.clip((bone * other_bone).sum(axis=1), -1, 1)))
                yield side + part, np.abs(roll), turn


@pytest.mark.parametrize("clip", CLIPS + RECORDED, ids=lambda path: f"{path.parent.name}-{path.stem}")
@conventions
def test_t_pose_and_a_pose_give_the_same_positions(convention, clip):
    assert apart(carried(clip, convention, "T"), carried(clip, convention, "A")) < 1e-4


@conventions
@pytest.mark.parametrize("angle", [-30, 30, 85, 90])
def test_arms_at_rest_may_hang_or_be_raised(convention, angle):
    for clip in (CLIPS[0], CLIPS[4]):
        motion = retarget(read(clip), lowered(rig(convention, "T"), angle)).motion
        assert apart(carried(clip, convention, "T"), motion) < 1e-4


@pytest.mark.parametrize("convention", ["mixamo", "xsens", "lafan1"])
def test_a_source_in_a_pose_is_the_same_motion(convention):
    clip = CLIPS[0]
    back, other = (retarget(carried(clip, convention, pose), read(clip).skeleton).motion for pose in ("T", "A"))
    assert apart(back, other) < 1e-4


@conventions
@pytest.mark.parametrize("pose", ["T", "A"])
@pytest.mark.parametrize(
    ("axes", "angles"),
    [("x", [90]), ("x", [-90]), ("z", [90]), ("zx", [90, 90]), ("zx", [180, 90]), ("y", [90]), ("y", [140])],
)
def test_a_target_may_stand_along_any_axis_and_face_anywhere(convention, pose, axes, angles):
    body = replace(rig(convention, pose), up=None)
    plain = retarget(read(CLIPS[4]), body)
    if convention == "unreal":  # Z up where the others have Y up
        axes = axes.translate(str.maketrans("yz", "zy"))
    turn = Rotation.from_euler(axes, angles, degrees=True)
    result = retarget(read(CLIPS[4]), body.with_offsets(turn.apply(np.array(body.offsets))))
    upright, other = (
        Rotation.from_quat(least_rotation(axis_vector("Y")[None], axis_vector(up)[None])[0])
        for up in (plain.world.up, result.world.up)
    )
    assert apart(moved(plain.motion, other * upright.inv()), result.motion) < 1e-4


@clips
@pytest.mark.parametrize("pose", ["T", "A"])
@pytest.mark.parametrize("convention", ["mixamo", "xsens", "lafan1"])
def test_no_limb_is_twisted_by_a_target_in_t_or_a_pose(convention, pose, clip):
    for name, roll, _ in rolls_and_directions(read(clip), carried(clip, convention, pose)):
        assert roll.max() < (3 if name.endswith("Foot") else 0.2), name  # the directions of feet differ between bodies


@pytest.mark.parametrize("convention", ["mixamo", "xsens", "lafan1"])
def test_no_limb_is_twisted_onto_the_same_names_in_another_pose(convention):
    for source, target in ("TA", "AT"):
        motion = carried(CLIPS[5], convention, source)
        for name, roll, turn in rolls_and_directions(motion, retarget(motion, rig(convention, target)).motion):
            assert roll.max() < 1, name
            assert turn.max() < 1, name


@cache
def there_and_back(clip, standing=False):
    """A clip, and the clip retargeted to a body with all bones along one axis at rest and back; the clip begins with
    a T-pose if `standing`.
    """
    motion = read(clip)
    if standing:
        still = np.tile(motion.skeleton.rest_rotations, (5, 1, 1))
        path = np.concatenate([np.tile(motion.root_positions[0], (5, 1)), motion.root_positions])
        motion = replace(motion, root_positions=path, rotations=np.concatenate([still, motion.rotations]))
    there = retarget(motion, rig("lafan1", "X")).motion if standing else carried(clip, "lafan1", "X")
    return motion, retarget(there, motion.skeleton).motion


@clips
def test_limbs_and_feet_keep_directions_and_roll_little_through_a_rest_pose_along_one_axis(clip):
    for name, _, turn in rolls_and_directions(*there_and_back(clip)):
        if not name.endswith(("Hand", "Foot")):
            assert turn.mean() < 4, name
            assert turn.max() < 10, name
    for name, roll, _ in rolls_and_directions(*there_and_back(clip)):
        assert roll.max() < (6 if name.endswith(LIMBS[1]) else 10), name
    motion, back = there_and_back(clip)
    for side in ("Left", "Right"):
        ankle, toe = (motion.skeleton.index(f"{side}{part}") for part in ("Ankle", "Toe"))
        a, b = ((x.positions[:, toe] - x.positions[:, ankle]) / x.skeleton.lengths[toe] for x in (motion, back))
        angle = np.degrees(np.arccos(np.clip((a * b).sum(axis=1), -1, 1)))
        assert angle.max() < 17, side


def test_limbs_roll_less_where_the_clip_shows_a_t_pose():
    for name, roll, turn in rolls_and_directions(*there_and_back(CLIPS[5], standing=True)):
        assert roll.max() < 6.5, name
        assert turn.max() < 8, name


@clips
def test_bones_along_one_axis_become_a_t_pose(clip):
    motion = carried(clip, "lafan1", "X")
    for limb in LIMBS:
        for side in ("left", "right"):
            for (_, a), (_, b) in list(
                zip(bones(motion, limb, side), bones(carried(clip, "lafan1", "T"), limb, side), strict=True)
            )[:2]:
                assert np.degrees(np.arccos(np.clip((a * b).sum(axis=1), -1, 1))).max() < 5


@clips
@pytest.mark.parametrize("pose", ["T", "A"])
@conventions
def test_joints_without_a_driver_stay_as_they_are_at_rest(convention, pose, clip):
    result = result_on(clip, convention, pose)
    free = (result.matching.rotation_sources[:, 0] < 0) & ~result.motion.skeleton.end_sites
    free[[0, *result.matching.target.handles]] = False
    turns = np.degrees(Rotation.from_quat(result.motion.rotations[:, free]).magnitude()).max(axis=0)
    names = np.array(result.motion.skeleton.names)[free]
    assert not [str(name) for name, turn in zip(names, turns, strict=True) if turn > 1e-3]


@pytest.mark.parametrize("places", [("ForeArm",), ("Hand",), ("ForeArm", "Hand", "Leg")])
def test_joints_within_a_limb_stay_straight(places):
    body = rig("lafan1", "T")
    for side in ("Left", "Right"):
        for place in places:
            body = divided(body, f"{side}{place}", f"{side}{place}Twist")
    result = retarget(read(CLIPS[5]), body).motion
    within = [joint for joint, name in enumerate(body.names) if name.endswith("Twist")]
    assert np.degrees(Rotation.from_quat(result.rotations[:, within]).magnitude()).max() < 1e-3
    plain = carried(CLIPS[5], "lafan1", "T")
    same = [body.index(name) for name in plain.skeleton.names]
    np.testing.assert_allclose(result.positions[:, same], plain.positions, rtol=0, atol=0.02 * Body.of(body).height)


def divided(body, name, middle):
    """The body with one more joint half way along the bone above `name`."""
    at = body.index(name)
    offsets = np.insert(body.offsets, at, body.offsets[at] / 2, axis=0)
    offsets[at + 1] /= 2
    parents = [parent + (parent >= at) for parent in body.parents]
    parents = [*parents[:at], int(body.parents[at]), at, *parents[at + 1 :]]
    channels = (*body.channels[:at], body.channels[at], *body.channels[at:])
    ends = np.insert(body.end_sites, at, False)
    names = (*body.names[:at], middle, *body.names[at:])
    return replace(body, names=names, parents=np.array(parents), offsets=offsets, channels=channels, end_sites=ends)


@pytest.mark.parametrize(("role", "axis"), [("head", 0), ("leftUpperArm", 2), ("rightUpperArm", 2)])
@conventions
def test_bones_of_neck_and_shoulders_are_built_differently_at_any_angle(convention, role, axis):
    """A bone of the trunk that lies elsewhere at rest turns no joint: neither neck nor head, shoulder nor hand."""
    plain = rig(convention, "A")
    offsets, joint = np.array(plain.offsets), by_names(plain).roles[role]
    sign = -1.0 if role == "rightUpperArm" else 1.0
    turn = Rotation.from_rotvec(sign * np.radians(80) * Body.of(plain).at_rest.axes[:, axis])
    offsets[joint] = turn.apply(offsets[joint])
    result, usual = (
        Rotation.from_quat(retarget(read(CLIPS[0]), body).rotation_copy.world_rotations)
        for body in (plain.with_offsets(offsets), plain)
    )
    assert np.degrees((result * usual.inv()).magnitude()).max() < 1e-6


def test_a_joint_between_hips_and_thigh_does_not_turn_the_thigh():
    """In CMU's files such a joint is at the hips, and its bone has a direction of its own on every body."""
    plain = divided(rig("mixamo", "T"), "mixamorig:LeftUpLeg", "LHipJoint")
    at, offsets = plain.index("LHipJoint"), np.array(plain.offsets)
    offsets[at : at + 2] += [[0.0, 0.0, 4.0], [0.0, 0.0, -4.0]]
    motion = retarget(read(CLIPS[5]), plain).motion
    result = retarget(motion, plain.with_offsets(offsets)).rotation_copy
    rest = [joint for joint in range(len(plain)) if joint != at]
    np.testing.assert_allclose(result.positions[:, rest], motion.positions[:, rest], rtol=0, atol=0.5)


@pytest.mark.parametrize("angle", [90, 180])
@clips
def test_a_motion_of_the_target_shows_a_roll_that_its_rest_pose_hides(clip, angle):
    """Arms along X whose joints are rolled about X look the same at rest; only their motion differs."""
    plain = carried(clip, "lafan1", "X")
    arm = [plain.skeleton.index(f"Right{part}") for part in ("Arm", "ForeArm", "Hand")]
    world = np.array(plain.world_rotations)
    roll = Rotation.from_euler("x", angle, degrees=True)
    world[:, arm] = (Rotation.from_quat(world[:, arm]) * roll).as_quat()
    local = world.copy()
    make_local(plain.skeleton.parents, local)
    own = replace(plain, rotations=local)
    np.testing.assert_allclose(own.positions[:, arm], plain.positions[:, arm], atol=1e-9)
    told = retarget(read(clip), own).motion
    untold = retarget(read(clip), plain.skeleton).motion
    for result, least, most in ((told, 0, 25), (untold, angle - 25, 180)):
        off = Rotation.from_quat(result.world_rotations[:, arm]) * Rotation.from_quat(world[:, arm]).inv()
        assert least <= np.degrees(np.median(off.magnitude(), axis=0)).min()
        assert np.degrees(np.median(off.magnitude(), axis=0)).max() <= most


@needs_corpus
def test_a_bvh_target_is_written_in_the_axes_of_its_own_motion():
    path = CORPUS / "pybvh" / "bvh_test3.bvh"
    goal = load_target(path).for_source(read(CLIPS[0]).skeleton)
    result = retarget(read(CLIPS[0]), goal)
    assert (result.world.source_up, result.world.up) == ("Y", "Z")
    assert retarget(read(CLIPS[0]), goal.skeleton).world.up == "Y"
