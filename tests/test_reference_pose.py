"""The pose in which a body is aligned: its rest pose, or a T-pose, the same for all clips of a rig."""

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bodies import SAMPLES, WAYS, matched, moved, nameless, on_skeleton, person, posed, sample, turned
from built_rigs import BUILDS, along_bones, bones_along_y, with_axes
from disguises import with_twists
from scipy.spatial.transform import Rotation
from skeleton_edits import with_chain, with_offset
from zoo import CONVENTIONS, rig

from distretarget import MatchingError, MotionError, match, read_bvh, retarget
from distretarget.baseline.rotation_copy import rest_alignment
from distretarget.body.anatomy import LEG, side_and_part
from distretarget.body.axes import Directions, axis_vector
from distretarget.body.body import Body
from distretarget.body.reference_pose import FOOT_PITCH, bend_axes, t_pose, usual_pitch
from distretarget.numerics.vectors import normalised

SIDES = {"left": 1.0, "right": -1.0}

ways = pytest.mark.parametrize("way", WAYS, ids=[f"way{k}" for k in range(len(WAYS))])


def assert_t_pose(body, world):
    """Trunk up along Y, legs down, arms out to the sides, left along X, feet ahead along Z."""
    left, up, forward = np.eye(3)
    way = Directions(body.anatomy, body.skeleton.posed(world))
    spine = [*body.anatomy.spine, *body.anatomy.neck, body.anatomy.roles["head"]]
    bones = normalised(np.diff(way.positions[spine], axis=0))
    np.testing.assert_allclose(bones, np.tile(up, (len(bones), 1)), atol=1e-9)
    for side, sign in SIDES.items():
        for upper, lower in itertools.pairwise((f"{side}UpperArm", f"{side}LowerArm", f"{side}Hand")):
            np.testing.assert_allclose(way.bone(upper, lower), sign * left, atol=1e-9)
        for upper, lower in itertools.pairwise((f"{side}UpperLeg", f"{side}LowerLeg", f"{side}Foot")):
            np.testing.assert_allclose(way.bone(upper, lower), -up, atol=1e-9)
        foot = np.cos(FOOT_PITCH) * forward - np.sin(FOOT_PITCH) * up
        np.testing.assert_allclose(way.bone(f"{side}Foot", f"{side}Toes"), foot, atol=1e-9)


@pytest.mark.parametrize("convention", CONVENTIONS)
@pytest.mark.parametrize("pose", "TA")
def test_a_rest_pose_in_which_a_person_stands_is_its_own_reference(convention, pose):
    body = rig(convention, pose)
    np.testing.assert_array_equal(Body.of(body).reference.rotations, body.rest_rotations)


def test_a_body_that_is_no_person_keeps_its_rest_pose():
    np.testing.assert_array_equal(Body(person(), None).reference.rotations, person().rest_rotations)


@pytest.mark.parametrize("along", [["X"], ["Y"], ["Y", "-Y"], ["Z", "-X"]])
@pytest.mark.parametrize("seed", range(5))
def test_a_body_whose_rest_pose_shows_no_left_is_retargeted_all_the_same(along, seed):
    body = rig("mixamo", "T")
    bones = np.random.default_rng(seed).choice([axis_vector(axis) for axis in along], len(body))
    flat = body.with_offsets(body.lengths[:, None] * bones)
    axes = Directions(Body.of(flat).anatomy, flat.rest_positions).axes
    np.testing.assert_allclose(Rotation.from_matrix(axes).as_matrix(), axes, atol=1e-12)
    walk = sample("walk")[:5]
    if Body.of(flat).on_all_fours:
        with pytest.raises(MatchingError, match="on all fours"):
            retarget(walk, flat)
    else:
        assert np.isfinite(retarget(walk, flat).motion.positions).all()


def test_shoulders_show_left_where_the_hip_joints_lie_along_the_spine():
    body = rig("lafan1", "X")
    offsets = np.array(body.offsets)
    for name, sign in (("LeftUpLeg", 1.0), ("RightUpLeg", -1.0)):
        offsets[body.index(name)] = sign * body.offsets[body.index("Spine")]
    flat = Body.of(body.with_offsets(offsets))
    assert not flat.stands_at_rest
    width = flat.reference.directions.across("UpperArm")
    np.testing.assert_allclose(normalised(width), [1.0, 0.0, 0.0], atol=0.01)


def test_without_a_motion_bones_along_one_axis_become_a_t_pose():
    body = Body.of(rig("lafan1", "X"))
    assert_t_pose(body, body.reference.rotations)


@pytest.mark.parametrize("build", BUILDS)
def test_without_a_motion_bones_in_pieces_are_straight(build):
    walk = with_twists(sample("walk")[:1])
    body = Body.of(with_axes(walk, build(Body.of_motion(walk))).skeleton)
    for limb in body.limbs:
        reach = np.linalg.norm(body.reference.positions[limb.end] - body.reference.positions[limb.top])
        assert reach == pytest.approx(body.skeleton.paths_from(limb.top)[limb.end])


def test_a_rest_pose_that_shows_no_side_of_joints_without_names_is_named():
    named = rig("lafan1", "X")
    lines = [retarget(sample("walk")[:5], each).warnings for each in (named, nameless(named), nameless(person()))]
    found = [[line for line in each if "show the left side of the target: the side that" in line] for each in lines]
    assert [len(each) for each in found] == [0, 1, 0]


@pytest.mark.parametrize("convention", ["mixamo", "xsens", "lafan1"])
@ways
def test_a_t_pose_faces_along_z_however_the_rest_pose_lies(convention, way):
    body = Body.of(turned(rig(convention, "A"), way))
    assert_t_pose(body, t_pose(body.skeleton, body.at_rest, None))


CLIPS = sorted(SAMPLES.glob("*.bvh"))


def bent(motion, turns):
    """The motion with joints turned by rotation vectors, (3,), by the ends of their names, in all frames."""
    rotations = np.array(motion.rotations)
    for name, turn in turns.items():
        for joint in (joint for joint, key in enumerate(motion.skeleton.names) if key.endswith(name)):
            rotations[:, joint] = (Rotation.from_quat(rotations[:, joint]) * Rotation.from_rotvec(turn)).as_quat()
    return replace(motion, rotations=rotations)


@cache
def clips_of_one_person():
    """The samples, and clips in which the body never stands, or head, wrists, one wrist or one straight leg are turned
    in all frames, or elbows bend backwards.
    """
    walk, squat, clap = (sample(name)[::3] for name in ("walk", "squat", "clap"))
    clips = [read_bvh(path)[::3] for path in CLIPS]
    clips.append(bent(walk, {"Head": [0.8, 0.0, 0.0], "Wrist": [0.7, 0.5, 0.0]}))
    crouch = {"Hip": [-0.5, 0.0, 0.0], "Knee": [0.9, 0.0, 0.0], "Ankle": [-0.4, 0.0, 0.0], "Chest": [0.3, 0.2, 0.0]}
    clips.append(bent(squat, crouch))
    clips.append(bent(walk, {"LeftWrist": [1.4, 0.0, 0.0]}))
    turned_out = {"Knee": [-0.2, 0.0, 0.0], "RightHip": [0.0, -0.9, 0.0], "RightAnkle": [0.0, 0.9, 0.0]}
    clips.append(bent(clap, turned_out))
    clips.append(bent(walk, {"LeftElbow": [0.0, 1.5, 0.0], "RightElbow": [0.0, -1.5, 0.0]}))
    clips.append(moved(clap, Rotation.from_euler("y", 70, degrees=True)))
    clips.append(walk[20:24])
    return clips


# How far an alignment may be from the known answer [degrees], by part; other parts 3. Neither OFFSETs nor a motion show
# how collar bones stand at rest, and whether the ends of toes are on the floor.
ALIGNED = {"Shoulder": 8.0, "Foot": 10.0, "Toes": 20.0}


@pytest.mark.parametrize("flat", [15.0, 25.0, 35.0])
def test_feet_stand_flat_as_the_flatter_one_rests(flat):
    """However long the other is on tiptoe, and whatever feet on tiptoe or on the heel alone do."""
    off_floor = [np.full(frames, pitch) for frames, pitch in ((20, 62.0), (10, 76.0), (15, -10.0))]
    found = usual_pitch(np.radians(np.concatenate([np.full(15, flat), *off_floor])))
    assert np.degrees(found) == pytest.approx(flat, abs=2.0)
    for pitches in off_floor:
        assert usual_pitch(np.radians(pitches)) == pytest.approx(FOOT_PITCH, abs=np.radians(3.0))


@pytest.mark.parametrize("build", BUILDS)
@pytest.mark.parametrize("target", [("mixamo", "T"), ("unreal", "A")])
def test_alignment_is_a_constant_of_two_rigs_whatever_a_clip_shows(build, target):
    """The known answer is the alignment of the same clip by its rest pose, in which the body stands."""
    for clip in clips_of_one_person():
        matching = matched(clip, rig(*target))
        axes = build(matching.source)
        own = matched(with_axes(clip, axes), rig(*target))
        assert matching.source.stands_at_rest
        assert not own.source.stands_at_rest
        turned = Rotation.from_quat(rest_alignment(own)[:, 0])
        for role, joint in own.target.anatomy.roles.items():
            driver = own.rotation_sources[joint, 0]
            if driver >= 0:
                known = Rotation.from_quat(rest_alignment(matching)[joint, 0])
                off = np.degrees((known.inv() * axes[driver] * turned[joint]).magnitude())
                assert off < ALIGNED.get(side_and_part(role)[1], 3.0), role


@pytest.mark.parametrize(("build", "target"), [*zip(BUILDS, [("mixamo", "T"), ("unreal", "A")] * 2, strict=False)])
def test_a_pose_in_which_the_body_stands_gives_the_known_alignment(build, target):
    for clip in clips_of_one_person():
        body = Body.of_motion(clip)
        axes = build(body)
        own = with_axes(clip, axes)
        still = replace(clip[:1], rotations=np.tile(body.skeleton.rest_rotations, (1, 1, 1)))
        turned = moved(with_axes(still, axes), Rotation.from_euler("y", 30, degrees=True))
        matching = match(Body.of_motion(own).standing_as(turned), Body.of(rig(*target)))
        aligned = Rotation.from_quat(rest_alignment(matching)[:, 0])
        known = Rotation.from_quat(rest_alignment(matched(clip, rig(*target)))[:, 0])
        for joint in matching.body_joints:
            off = known[joint].inv() * axes[matching.rotation_sources[joint, 0]] * aligned[joint]
            assert np.degrees(off.magnitude()) < 0.1


def test_a_pose_that_does_not_show_how_the_body_stands_is_refused():
    clip = sample("walk")[:3]
    own = with_axes(clip, along_bones(Body.of_motion(clip)))
    still = replace(own[:1], rotations=np.tile(own.skeleton.rest_rotations, (1, 1, 1)))
    other = retarget(clip, rig("mixamo", "T")).motion
    for rest, reason in ((own[:0], "no frames"), (still, "nobody can stand"), (other, "other joints")):
        with pytest.raises(MotionError, match=reason):
            retarget(own, rig("mixamo", "T"), rest=rest)


@pytest.mark.parametrize("standing", [True, False])
@pytest.mark.parametrize("target", [("mixamo", "T"), ("xsens", "A")])
def test_a_head_is_turned_by_the_body_not_by_jaw_or_nose(standing, target):
    """The only bones below the head point forward: to a jaw, and to an End Site."""
    clip = sample("walk")[::5]
    skeleton = clip.skeleton
    faced = replace(clip, skeleton=with_offset(skeleton, skeleton.index("Head_End"), [0.0, 1.0, 8.0]))
    face = with_chain(faced.skeleton, skeleton.index("Head"), {"Jaw": [0.0, -2.0, 6.0], "Teeth": [0.0, -1.0, 4.0]})
    goal = rig(*target)
    goal = with_chain(goal, next(j for j, name in enumerate(goal.names) if name.endswith("Head")), {"Jaw": [0, 4.0, 0]})
    known, *others = (matched(each, goal) for each in (clip, faced, on_skeleton(clip, face), on_skeleton(faced, face)))
    for other in others:
        if not standing:
            axes = along_bones(other.source)
            other = matched(with_axes(other.source_motion, axes), goal)
        role = other.target.anatomy.roles["head"]
        own = Rotation.from_quat(rest_alignment(other)[role, 0])
        own = own if standing else axes[other.drivers[role]] * own
        off = Rotation.from_quat(rest_alignment(known)[role, 0]).inv() * own
        assert np.degrees(off.magnitude()) < 3


@pytest.mark.parametrize("build", BUILDS)
def test_a_body_is_as_high_as_it_stands_whatever_its_rest_pose(build):
    for name in ("walk", "squat"):
        clip = sample(name)[::5]
        body = Body.of_motion(clip)
        own = Body.of_motion(with_axes(clip, build(body)))
        assert own.height == pytest.approx(body.height, rel=0.02)
        assert Body.of(own.skeleton).height == pytest.approx(body.height, rel=0.05)


def test_elbows_and_knees_bend_about_the_axes_across_them():
    bend = np.linspace(0.2, 1.2, 10)[:, None]
    turns = {f"{side}Knee": bend * [1, 0, 0] for side in ("Left", "Right")}
    turns |= {"LeftElbow": bend * [0, -1, 0], "RightElbow": bend * [0, 1, 0]}
    motion = posed(person(), turns, np.zeros((10, 3)))
    anatomy = Body.of_motion(motion).anatomy
    axes = bend_axes(anatomy, motion)
    bends = {"left": [0, -1, 0], "right": [0, 1, 0]}
    expected = {f"{side}{part}": [1, 0, 0] for side in SIDES for part in LEG[:3]}
    expected |= {f"{side}{part}": bends[side] for side in SIDES for part in ("UpperArm", "LowerArm")}
    assert axes.keys() == {anatomy.roles[role] for role in expected}
    for role, axis in expected.items():
        np.testing.assert_allclose(axes[anatomy.roles[role]], axis, atol=1e-9)


def test_arms_that_hardly_bend_have_no_axis_but_straight_legs_that_of_their_feet():
    motion = posed(person(), {"LeftElbow": np.array([0, -0.5, 0])}, np.zeros((5, 3)))
    anatomy = Body.of_motion(motion).anatomy
    axes = bend_axes(anatomy, motion)
    legs = {anatomy.roles[f"{side}{part}"] for side in SIDES for part in LEG[:3]}
    assert axes.keys() == legs | {anatomy.roles[role] for role in ("leftUpperArm", "leftLowerArm")}
    for joint in legs:
        np.testing.assert_allclose(axes[joint], [1.0, 0.0, 0.0], atol=1e-9)


def test_a_spine_leans_as_that_of_its_convention():
    body = Body.of_motion(sample("walk")[::5])
    own = Body.of_motion(with_axes(body.motion, bones_along_y(body)))
    anatomy, end = own.anatomy, own.skeleton.index("Head_End")
    chain = [*anatomy.spine, *anatomy.neck, anatomy.roles["head"], end]
    neck, roles = tuple(chain[3:5]), {**anatomy.roles, "head": end}
    plain, leaning = (
        replace(own, anatomy=replace(anatomy, neck=neck, roles=roles, convention=convention))
        for convention in ("", "Character Creator")
    )
    turns = [Rotation.from_quat(each.reference.rotations[chain]) for each in (plain, leaning)]
    leans = np.outer([16.5, -5.0, -10.5, 11.0, 10.0, 0.0], [1.0, 0.0, 0.0])
    np.testing.assert_allclose((turns[1] * turns[0].inv()).as_rotvec(degrees=True), leans, atol=1e-9)


def test_joints_that_nothing_drives_are_turned_as_in_the_motion_of_a_target_that_does_not_stand_at_rest():
    walk = sample("walk")[::5]
    own = with_axes(walk, along_bones(Body.of_motion(walk)))
    faced = on_skeleton(own, with_chain(own.skeleton, own.skeleton.index("Head"), {"Jaw": [0.0, 4.0, 6.0]}))
    turn = Rotation.from_euler("xz", [90, 90], degrees=True).as_quat()
    rotations = np.array(faced.rotations)
    rotations[:, -1] = turn
    result = retarget(walk, replace(faced, rotations=rotations)).motion
    np.testing.assert_allclose(np.abs(result.rotations[:, -1] @ turn), 1.0)
