"""Roots on the floor and IK handles of rigs for game engines, placed last; and the path where a root cannot move."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from animals import on_a_root
from bodies import matched, person, posed, sample, sample_target, with_bone
from scipy.spatial.transform import Rotation
from zoo import rig

from distretarget import Motion, MotionError, Options, read_bvh, retarget, write_bvh
from distretarget.baseline.engine_root import find_engine_root, path_carriers
from distretarget.baseline.rotation_copy import RootScale, rotation_copy
from distretarget.body.body import Body
from distretarget.skeleton import POSITION_CHANNELS, ROTATION_CHANNELS, Skeleton

UNREAL = rig("unreal", "T")
HANDLES = {
    "ik_foot_l": "foot_l",
    "ik_foot_r": "foot_r",
    "ik_hand_gun": "hand_r",
    "ik_hand_l": "hand_l",
    "ik_hand_r": "hand_r",
}
FLESH = [j for j in range(len(UNREAL)) if UNREAL.names[j] != "root" and not UNREAL.names[j].startswith("ik_")]
ROOTS = [UNREAL.index(name) for name in ("root", "ik_foot_root", "ik_hand_root")]
LIMIT = 1e-9 * 170  # places are equal if they differ by less [cm]


@cache
def onto_unreal(name):
    return retarget(sample(name), UNREAL)


def headings(motion, joint=0):
    """(frames,), the heading of a joint of a rig with Z up, and how far it is tilted, at most [degrees]."""
    turns = Rotation.from_quat(motion.world_rotations[:, joint])
    ahead = turns.apply([0, -1, 0])
    tilt = np.degrees(np.arccos(np.clip(turns.apply([0, 0, 1])[:, 2], -1, 1)))
    return np.degrees(np.unwrap(np.arctan2(ahead[:, 0], -ahead[:, 1]))), tilt.max()


def tilted(turns):
    """A person whose hips take these rotations, on the rig."""
    path = np.tile([0.0, 0.9, 0.0], (len(turns), 1))
    motion = posed(person(), {"Hips": turns.as_rotvec()}, path, "0.0333333")
    return retarget(motion, UNREAL, Options(source_up="Y", supports="free")).motion


def rotations(axis, degrees):
    return Rotation.from_euler(axis, np.atleast_1d(degrees)[:, None] if np.ndim(degrees) else degrees, degrees=True)


def with_channels(name, keep):
    """The rig with only those channels of a joint that `keep` has."""
    channels = list(UNREAL.channels)
    channels[UNREAL.index(name)] = tuple(keep)
    return replace(UNREAL, channels=tuple(channels))


def with_root_motion(motion, path, turns):
    """The motion on a root named as Unreal's that goes along a path, (frames, 3), and turns about Y by `turns`."""
    rooted = on_a_root(motion, "root")
    translations, local = rooted.translations, np.array(rooted.rotations)
    back = turns.inv()
    translations[:, 1] = back.apply(rooted.positions[:, 1] - path)
    local[:, 1] = (back * Rotation.from_quat(rooted.world_rotations[:, 1])).as_quat()
    translations[:, 0], local[:, 0] = path, turns.as_quat()
    return Motion.of_translations(rooted.skeleton, translations, local, motion.frame_time_text)


@pytest.mark.parametrize("name", ["squat", "walk", "turn"])
def test_the_root_stays_on_the_floor_under_the_pelvis_turns_with_it_and_is_never_tilted(name):
    motion = onto_unreal(name).motion
    pelvis = motion.positions[:, UNREAL.index("pelvis")]
    for joint in ROOTS:
        np.testing.assert_allclose(motion.positions[:, joint], pelvis * [1, 1, 0], atol=LIMIT)
    assert np.ptp(pelvis[:, 2]) > 1
    motion = onto_unreal(name).motion
    heading, tilt = headings(motion)
    body_heading, _ = headings(motion, UNREAL.index("pelvis"))
    assert tilt < 1e-6
    np.testing.assert_allclose(heading, body_heading, atol=1.0)
    assert name != "turn" or np.ptp(heading) > 359


def test_the_root_stays_upright_on_the_floor_of_another_world():
    motion = retarget(sample("squat"), UNREAL, Options(target_up="Y")).motion
    pelvis = motion.positions[:, UNREAL.index("pelvis")]
    np.testing.assert_allclose(motion.root_positions, pelvis * [1, 0, 1], atol=LIMIT)
    ups = Rotation.from_quat(motion.rotations[:, 0]).apply([0, 0, 1])
    np.testing.assert_allclose(ups, np.tile([0.0, 1.0, 0.0], (len(ups), 1)), atol=1e-12)


@pytest.mark.parametrize("name", ["squat", "walk", "clap"])
def test_handles_have_the_pose_of_what_they_are_named_for(name):
    for motion in (onto_unreal(name).motion, onto_unreal(name).rotation_copy):
        for handle, joint in HANDLES.items():
            a, b = UNREAL.index(handle), UNREAL.index(joint)
            np.testing.assert_allclose(motion.positions[:, a], motion.positions[:, b], atol=LIMIT)
            turns = Rotation.from_quat(motion.world_rotations[:, [a, b]].reshape(-1, 4))
            np.testing.assert_allclose((turns[::2].inv() * turns[1::2]).magnitude(), 0, atol=1e-9)


@pytest.mark.parametrize("follows", ["pelvis", "nothing"])
@pytest.mark.parametrize("name", ["squat", "turn"])
def test_the_body_does_not_move(name, follows):
    result = onto_unreal(name)
    before = rotation_copy(result.matching, RootScale.even(result.root_scale))
    after = find_engine_root(result.matching, RootScale.even(result.root_scale), follows).placed(before)
    np.testing.assert_allclose(after.positions[:, FLESH], before.positions[:, FLESH], atol=LIMIT)
    dots = (after.world_rotations[:, FLESH] * before.world_rotations[:, FLESH]).sum(axis=-1)
    np.testing.assert_allclose(np.abs(dots), 1, atol=1e-12)
    assert np.abs(after.root_positions - before.root_positions).max() > 1


@pytest.mark.parametrize("name", ["squat", "turn"])
def test_a_file_keeps_root_and_handles(name, tmp_path):
    motion = onto_unreal(name).motion
    write_bvh(tmp_path / "out.bvh", motion)
    again = read_bvh(tmp_path / "out.bvh")
    order = [again.skeleton.index(key) for key in UNREAL.keys]
    np.testing.assert_allclose(again.positions[:, order], motion.positions, atol=1e-4)


def test_a_root_that_follows_nothing_stays_at_the_origin():
    motion = retarget(sample("walk"), UNREAL, Options(root_follows="nothing")).motion
    np.testing.assert_allclose(motion.root_positions, 0, atol=LIMIT)
    np.testing.assert_allclose(np.abs(motion.rotations[:, 0, 3]), 1)
    pelvis = UNREAL.index("pelvis")
    np.testing.assert_allclose(motion.positions[:, pelvis], onto_unreal("walk").motion.positions[:, pelvis], atol=LIMIT)


@pytest.mark.parametrize("axis", ["X", "-X", "Z"])
@pytest.mark.parametrize("heading", [0, 70, 200])
def test_lying_down_keeps_the_heading(axis, heading):
    falls = rotations(axis[-1], np.linspace(0, -90 if axis[0] == "-" else 90, 40))
    yaw, tilt = headings(tilted(rotations("Y", heading) * falls))
    np.testing.assert_allclose((yaw - heading + 180) % 360 - 180, 0, atol=1e-3)
    assert tilt < 1e-6


def test_rolling_on_the_floor_turns_the_root_evenly():
    steps = np.linspace(0, 360, 120)
    yaw, _ = headings(tilted(rotations("X", 80) * rotations("Y", steps)))
    assert np.abs(np.diff(yaw)).max() < 6


@pytest.mark.parametrize("side", [0, 3, 12])
def test_a_somersault_does_not_flip_the_heading(side):
    turns = rotations("Z", side) * rotations("X", np.linspace(0, 360, 180))
    yaw, _ = headings(tilted(turns))
    assert np.abs(np.diff(yaw)).max() < 6
    assert np.ptp(yaw) < 60


def test_a_body_that_is_always_upside_down_has_a_root_that_keeps_its_heading():
    yaw, _ = headings(tilted(rotations("X", np.linspace(170, 190, 9))))
    np.testing.assert_allclose(yaw, 0, atol=1e-6)


def test_the_root_follows_the_sources_root():
    source = sample("walk")
    frames = np.linspace(0, 1, len(source))[:, None]
    path, turns = frames * [[30.0, 0.0, 80.0]], rotations("Y", 90 * frames[:, 0])
    rooted = with_root_motion(source, path, turns)
    np.testing.assert_allclose(rooted.positions[:, 1:], source.positions, atol=1e-9)
    for motion in (retarget(rooted, UNREAL), retarget(rooted, UNREAL, Options(root_follows="source"))):
        expected = motion.root_scale * path[:, [0, 2, 1]] * [1, -1, 1]
        np.testing.assert_allclose(motion.motion.root_positions, expected, atol=LIMIT)
        yaw, tilt = headings(motion.motion)
        np.testing.assert_allclose(yaw, 90 * frames[:, 0], atol=1e-6)
        assert tilt < 1e-6
    under = retarget(rooted, UNREAL, Options(root_follows="pelvis")).motion
    pelvis = UNREAL.index("pelvis")
    np.testing.assert_allclose(under.root_positions, under.positions[:, pelvis] * [1, 1, 0], atol=LIMIT)
    np.testing.assert_allclose(under.positions[:, pelvis], motion.motion.positions[:, pelvis], atol=1e-3)


@pytest.mark.parametrize(("rise", "leads"), [(0.01, True), (0.05, False)])
def test_a_source_root_that_leaves_the_floor_does_not_lead(rise, leads):
    """A root that bobs with every step is no root on the floor, however low it is; `rise` is in leg lengths."""
    source = sample("walk")
    frames = np.linspace(0, 1, len(source))[:, None]
    path = frames * [[30.0, 0.0, 80.0]]
    path[:, 1] = rise * Body.of_motion(source).leg_length * np.sin(20 * frames[:, 0]).clip(0)
    result = retarget(with_root_motion(source, path, rotations("Y", 0 * frames[:, 0])), UNREAL)
    along, pelvis = result.motion.root_positions, result.motion.positions[:, UNREAL.index("pelvis")]
    expected = result.root_scale * path[:, [0, 2, 1]] * [1, -1, 1] if leads else pelvis
    np.testing.assert_allclose(along[:, :2], expected[:, :2], atol=LIMIT)


@pytest.mark.parametrize(("below", "on_floor"), [(0.2, False), (0.35, True), (1.0, True)])
def test_a_root_well_below_the_hips_is_one_on_the_floor(below, on_floor):
    """Even if it is off the floor by the rig's mistake; a root a little below the hips is their own."""
    offsets, pelvis = np.array(UNREAL.offsets), UNREAL.index("pelvis")
    offsets[pelvis] *= below * Body.of(UNREAL).leg_length / np.linalg.norm(offsets[pelvis])
    matching = matched(sample("walk"), UNREAL.with_offsets(offsets))
    assert (0 in find_engine_root(matching, RootScale.even(1.0)).moving) == on_floor


def test_a_clip_of_the_rig_keeps_its_root_on_the_rig():
    motion = onto_unreal("walk").motion
    again = retarget(motion, UNREAL).motion
    np.testing.assert_allclose(again.root_positions, motion.root_positions, atol=1e-6)
    np.testing.assert_allclose(headings(again)[0], headings(motion)[0], atol=1e-6)


@pytest.mark.parametrize("name", ["Reference", "root"])
def test_a_source_root_that_never_moves_leads_only_a_root_of_the_same_name(name):
    motion = retarget(on_a_root(sample("walk"), name), UNREAL).motion
    assert (np.ptp(motion.root_positions, axis=0).max() > 10) == (name == "Reference")


def test_without_a_root_on_the_floor_the_source_cannot_lead():
    with pytest.raises(MotionError, match="no root on the floor to follow"):
        retarget(sample("squat"), UNREAL, Options(root_follows="source"))
    retarget(sample("squat"), sample("squat").skeleton, Options(root_follows="source"))


@pytest.mark.parametrize("channels", [ROTATION_CHANNELS, POSITION_CHANNELS])
def test_a_pelvis_that_cannot_stay_in_place_takes_the_root_along(channels):
    body = with_channels("pelvis", channels)
    engine_root = find_engine_root(matched(sample("squat"), body), RootScale.even(1.0))
    assert 0 not in engine_root.moving
    assert set(engine_root.moving) == {body.index(name) for name in HANDLES}


def test_handles_that_only_turn_follow_their_parents():
    body = with_channels("ik_foot_l", ROTATION_CHANNELS)
    assert Body.of(body).handles.keys() == {body.index(name) for name in HANDLES if name != "ik_foot_l"}
    motion = retarget(sample("squat"), body).motion
    np.testing.assert_allclose(np.abs(motion.rotations[:, body.index("ik_foot_l"), 3]), 1)
    np.testing.assert_array_equal(
        motion.translations[1:, body.index("ik_foot_l")], motion.translations[:-1, body.index("ik_foot_l")]
    )


def test_a_map_overrules_what_a_handle_copies():
    result = retarget(sample("squat"), UNREAL, joint_map={"ik_hand_gun": "LeftWrist"})
    places = result.motion.positions
    apart = np.linalg.norm(places[:, UNREAL.index("ik_hand_gun")] - places[:, UNREAL.index("hand_r")], axis=1)
    assert apart.max() > 1


@pytest.mark.parametrize(
    ("handle", "joint"),
    [
        ("LeftHandIK", "LeftHand"),
        ("IKFoot.R", "Foot.R"),
        ("VB ik_toes_l", "toes_l"),
        ("mixamorig:LeftFootIK", "mixamorig:LeftFoot"),
        ("LeftHandPole", None),
        ("LeftForeArmIK", None),
        ("Spike", None),
    ],
)
def test_handles_are_known_by_their_names(handle, joint):
    body = rig("mixamo", "T")
    renamed = {"Foot.R": "mixamorig:RightFoot", "toes_l": "mixamorig:LeftToeBase", "LeftHand": "mixamorig:LeftHand"}
    names = [joint if name == renamed.get(joint) else name for name in body.names]
    body = with_bone(replace(body, names=tuple(names)), handle, body.names[0])
    body = replace(body, channels=(*body.channels[:-1], POSITION_CHANNELS + ROTATION_CHANNELS))
    found = {body.names[a]: body.names[b] for a, b in Body.of(body).handles.items()}
    assert found == ({handle: joint} if joint else {})


PATH = POSITION_CHANNELS
TURN = ("Zrotation", "Xrotation", "Yrotation")


def below(channels, offset=(0.0, 0.0, 0.0), hips=(*PATH, *TURN)):
    """A person below a root with these channels; the hips are joint 1."""
    body = person()
    return Skeleton(
        names=("Armature", *body.names),
        parents=np.array([-1, *(body.parents + 1)]),
        offsets=np.vstack([offset, [0.0, 0.9, 0.0], body.offsets[1:]]),
        channels=(channels, hips, *body.channels[1:]),
        end_sites=np.array([False, *body.end_sites]),
    )


def squat():
    return sample("squat")


def rewritten(motion, folder):
    """The positions of the joints after a round trip through a BVH file, which has them depth first."""
    write_bvh(folder / "out.bvh", motion)
    return read_bvh(folder / "out.bvh").positions[:, np.argsort(motion.skeleton.depth_first)]


@pytest.mark.parametrize("channels", [(), TURN, ("Yposition",), ("Xposition", "Zposition", *TURN)])
@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (0.3, 0.1, -0.2)])
def test_hips_carry_the_path_that_the_root_cannot(channels, offset, tmp_path):
    usual = retarget(squat(), below((*PATH, *TURN))).motion
    result = retarget(squat(), below(channels, offset))
    written = rewritten(result.motion, tmp_path)[:, 1:]
    np.testing.assert_allclose(written, result.motion.positions[:, 1:], atol=1e-6)
    across = written - usual.positions[:, 1:]
    np.testing.assert_allclose(across, np.broadcast_to(across[0, 0], across.shape), atol=1e-6)
    assert not result.warnings
    held = [axis for axis, channel in enumerate(PATH) if channel not in channels]
    np.testing.assert_allclose(result.motion.root_positions[:, held], np.broadcast_to(offset, (len(usual), 3))[:, held])


def test_a_target_that_cannot_travel_says_so_and_its_figures_are_those_of_the_file(tmp_path):
    result = retarget(squat(), below((), hips=TURN))
    assert result.warnings[0] == (
        "the body stays in place: the target's root 'Armature' and the joints below lack position channels"
    )
    written = rewritten(result.motion, tmp_path)
    np.testing.assert_allclose(written, result.motion.positions, atol=1e-6)
    assert np.ptp(written[:, 1], axis=0).max() == 0.0
    assert "feet skate more than in the source" in result.verdict
    assert "Check: foot skate, foot height" in result.verdict


def test_carriers_are_the_topmost_joints_that_hold_the_whole_body():
    body = np.arange(1, len(person()) + 1)
    assert path_carriers(below((*PATH, *TURN)), body) == []
    assert path_carriers(below(TURN), body) == [1]
    assert path_carriers(below(TURN, hips=TURN), body) is None
    deeper = below(TURN, hips=TURN)
    channels = list(deeper.channels)
    channels[2] = (*PATH, *TURN)
    chest = replace(deeper, channels=tuple(channels))
    assert path_carriers(chest, np.array(chest.subtree(2))) == [2]
    assert path_carriers(chest, body) is None


def test_other_targets_keep_their_motion():
    target = sample_target("long_arms")
    assert retarget(squat(), target).motion.moving is None
