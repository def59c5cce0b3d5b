"""Any rig: four conventions, roots on the floor, animals, props, incomplete bodies and maps."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from animals import camera, dog, on_a_root, sword
from bodies import body_of, lengthened, matched, nameless, posed, sample, short_walk, swaying, taken
from disguises import Disguise
from scipy.spatial.transform import Rotation
from zoo import CONVENTIONS, RIG_POSES, RIGS, rig

from distretarget import Motion, retarget
from distretarget.body.anatomy import ARM, LEG
from distretarget.body.body import Body
from distretarget.body.recognition import by_names
from distretarget.errors import MatchingError
from distretarget.matching.matching import find_matching
from distretarget.numerics.vectors import normalised
from distretarget.skeleton import POSITION_CHANNELS

# The names of the sample's joints in Bandai Namco's files.
BANDAI = Disguise(
    (
        ("Hips", "Spine", "Spine1", "Chest", "Neck", "Head"),
        tuple(f"{part}_{{}}" for part in (*ARM, *LEG)),
        ("L", "R"),
    )
).by_sample
BEINGS = {
    "dog": dog(),
    "dog with names of people": dog(own_names=False),
    "dog without names": nameless(dog()),
    "sword": sword(),
    "camera": camera(),
}

conventions = pytest.mark.parametrize("convention", CONVENTIONS)
beings = pytest.mark.parametrize("being", BEINGS)


@cache
def bandai():
    """The walk as in Bandai Namco's files: a root on the floor that stays, and hips with positions below it."""
    named = tuple(BANDAI.get(name, name) for name in short_walk().skeleton.names)
    below = replace(short_walk(), skeleton=replace(short_walk().skeleton, names=named))
    return on_a_root(below, "joint_Root")


def still(body, frames=4):
    return posed(body, {}, np.tile(body.offsets[0], (frames, 1)))


def hips(motion):
    return motion.positions[:, by_names(motion.skeleton).roles["hips"]]


def assert_near(found, expected, relative=1e-5):
    np.testing.assert_allclose(found, expected, rtol=0, atol=relative * np.ptp(expected, axis=(0, 1)).max())


def test_hips_below_a_root_on_the_floor_carry_the_motion():
    for name in CONVENTIONS:
        plain, below = (retarget(source, rig(name, "T")) for source in (short_walk(), bandai()))
        assert below.root_scale == pytest.approx(plain.root_scale)
        assert_near(below.motion.positions, plain.motion.positions)


@pytest.mark.parametrize("root", ["Reference", "Armature", "reference_node", "q"])
def test_a_joint_above_the_hips_that_never_moves_does_not_hold_them(root):
    source = on_a_root(short_walk(), root)
    plain = retarget(short_walk(), rig("lafan1", "A")).motion
    assert_near(retarget(source, rig("lafan1", "A")).motion.positions, plain.positions)


def test_a_joint_above_the_hips_does_not_hold_them_where_nothing_has_a_name():
    source = on_a_root(short_walk(), "root")
    plain = retarget(short_walk(), rig("lafan1", "A"))
    result = retarget(replace(source, skeleton=nameless(source.skeleton)), rig("lafan1", "A"))
    roles = by_names(rig("lafan1", "A")).roles
    joints = [roles[role] for role in roles if role not in ("leftShoulder", "rightShoulder")]
    assert_near(result.motion.positions[:, joints], plain.motion.positions[:, joints], 1e-3)


@conventions
def test_from_a_root_on_the_floor_to_hips_and_back(convention):
    there = retarget(short_walk(), rig("unreal", "T")).motion
    result = retarget(there, rig(convention, "T"))
    plain = retarget(short_walk(), rig(convention, "T")).motion
    joints = [joint for role, joint in by_names(plain.skeleton).roles.items() if role.endswith(("Leg", "Arm", "hips"))]
    assert_near(result.motion.positions[:, joints], plain.positions[:, joints], 0.03)


def test_onto_hips_with_positions_below_a_root_on_the_floor():
    target = bandai().skeleton
    assert target.channels[1][:3] == POSITION_CHANNELS
    result = retarget(short_walk(), target)
    assert result.drivers[0] < 0
    assert_near(result.motion.positions[:, 1:], short_walk().positions)


@pytest.mark.parametrize("clip", ["walk", "turn", "squat"])
def test_a_root_on_the_floor_that_feet_pass_changes_nothing(clip):
    motion = sample(clip)
    target = lengthened(motion.skeleton, {"Knee": 0.7, "Ankle": 0.7, "Elbow": 1.3})
    rooted = on_a_root(posed(target, {}, np.zeros((1, 3))), "root").skeleton
    expected = retarget(motion, target).motion.positions
    found = retarget(on_a_root(motion, "root"), rooted).motion.positions[:, 1:]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6 * Body.of(target).height)


@conventions
@beings
def test_no_animal_or_prop_is_taken_for_a_person(being, convention):
    person, body = rig(convention, "T"), BEINGS[being]
    for source, target in ((person, body), (body, person)):
        with pytest.raises(MatchingError) as caught:
            retarget(still(source), target)
        message = str(caught.value)
        assert "\n" not in message
        assert "closest names: " in message or all(repr(body.names[0]) in message for body in (source, target))
        assert message.endswith("say in a map which source joint drives which target joint")
        assert set(caught.value.source) == {*np.array(source.names)[~source.end_sites]}
        assert set(caught.value.target) == {*np.array(target.names)[~target.end_sites]}


@pytest.mark.parametrize("source", BEINGS)
@pytest.mark.parametrize("target", BEINGS)
def test_animals_and_props_are_not_taken_for_each_other(source, target):
    if source == target:
        assert np.all(matched(BEINGS[source], BEINGS[target]).drivers >= 0)
    else:
        with pytest.raises(MatchingError):
            matched(still(BEINGS[source]), BEINGS[target])


@pytest.mark.parametrize("own_names", [True, False])
@pytest.mark.parametrize("turn", [None, [90, 0, 0], [0, 90, 0]])
def test_a_dog_moves_on_a_dog_of_another_build(own_names, turn):
    body = dog(own_names=own_names)
    motion = swaying(body, angle=0.3)
    if turn:
        rotation = Rotation.from_euler("xyz", turn, degrees=True)
        body = body.with_offsets(rotation.apply(np.array(body.offsets)))
        motion = swaying(body, angle=0.3)
    target = lengthened(body, {"Radius": 1.4, "Tibia": 0.7, "back": 1.2, "ForeArm": 1.4, "Leg": 0.7, "Spine1": 1.2})
    result = retarget(motion, target)
    assert set(result.matching.method) == {"name", "tip"}
    np.testing.assert_array_equal(result.drivers, np.arange(len(body)))
    turns = np.abs((result.rotation_copy.rotations * motion.rotations).sum(axis=-1))
    np.testing.assert_allclose(turns, 1, atol=1e-9, err_msg="rotations of the copy")
    bones = np.linalg.norm(np.diff(result.motion.positions[:, [0, 1]], axis=1), axis=-1)
    np.testing.assert_allclose(bones, target.lengths[1])


def test_an_animal_that_stands_on_shorter_legs_stands_as_it_is():
    """Hind legs of more bones than people's stand where the copied ones do."""
    changed = {"Radius": 0.9, "Tibia": 0.8, "Hock": 1.1, "back": 1.3}
    bodies = [dog(), lengthened(dog(), changed)]
    source, target = (replace(body, names=tuple(f"J{joint}" for joint in range(len(body)))) for body in bodies)
    result = retarget(still(source, frames=30), target)
    held = [bodies[0].names[joint] for joint in result.supports.joints]
    assert "LeftHindpaw" in held
    turned = [Rotation.from_quat(each.rotations[15]) for each in (result.rotation_copy, result.motion)]
    assert np.degrees((turned[0].inv() * turned[1]).magnitude()).max() < 2.0


@conventions
def test_an_explicit_map_carries_an_arm_onto_a_sword(convention):
    source = still(rig(convention, "T"))
    roles = by_names(source.skeleton).roles
    hand, fore = (source.skeleton.keys[roles[role]] for role in ("rightHand", "rightLowerArm"))
    result = retarget(source, sword(), joint_map={"grip": fore, "guard": hand})
    assert result.matching.method[:2] == ("map", "map")
    line = result.motion.positions[:, 1] - result.motion.positions[:, 0]
    arm = source.positions[:, roles["rightHand"]] - source.positions[:, roles["rightLowerArm"]]
    turned = result.source.positions[:, roles["rightHand"]] - result.source.positions[:, roles["rightLowerArm"]]
    np.testing.assert_allclose(np.linalg.norm(line, axis=1), 18)
    np.testing.assert_allclose(line / 18, turned / np.linalg.norm(arm, axis=1, keepdims=True), atol=1e-6)


def test_an_explicit_map_carries_a_person_onto_a_dog():
    target = dog()
    legs = {"LeftFemur": "LeftHip", "LeftTibia": "LeftKnee", "RightFemur": "RightHip", "RightTibia": "RightKnee"}
    result = retarget(short_walk(), target, joint_map=legs | {"croup": "Hips"})
    assert np.all(np.isfinite(result.motion.positions))
    assert result.drivers[target.index("LeftTibia")] == short_walk().skeleton.index("LeftKnee")


# ---- bodies that lack a part


def part(motion, top="Hips", without=()):
    """The motion of the joints from `top` down, without those whose names end in a word of `without`, and all below."""
    body = motion.skeleton
    lost = {below for joint, name in enumerate(body.names) if name.endswith(without) for below in body.subtree(joint)}
    kept = [joint for joint in body.subtree(body.index(top)) if joint not in lost]
    left = taken(body, kept)
    left = replace(left, channels=(body.channels[0], *left.channels[1:]))
    translations, rotations = motion.translations[:, kept], motion.rotations[:, kept]
    translations[:, 0], rotations[:, 0] = motion.positions[:, kept[0]], motion.world_rotations[:, kept[0]]
    return Motion.of_translations(left, translations, rotations, motion.frame_time_text)


LACKS = {
    "legs": ("Hip",),
    "a leg": ("LeftHip",),
    "feet": ("Ankle",),
    "arms": ("Collar",),
    "an arm": ("RightCollar",),
    "head": ("Neck",),
    "all but legs": ("Chest",),
}


@conventions
@pytest.mark.parametrize("lacks", LACKS)
def test_an_incomplete_body_moves_a_whole_one(convention, lacks):
    whole, body = retarget(short_walk(), rig(convention, "A")), rig(convention, "A")
    result = retarget(part(short_walk(), without=LACKS[lacks]), body)
    assert result.world.up == whole.world.up
    driven = np.flatnonzero(result.drivers >= 0)
    shared = driven[(result.drivers[body.parents[driven]] >= 0) & (driven > 0) & (body.lengths[driven] > 0)]
    bones = [
        normalised(x.positions[:, shared] - x.positions[:, body.parents[shared]]) for x in (result.motion, whole.motion)
    ]
    assert np.degrees(np.arccos(np.clip((bones[0] * bones[1]).sum(axis=-1), -1, 1))).mean() < 10


@pytest.mark.parametrize("top", ["Chest3", "LeftHip", "RightCollar"])
def test_a_whole_person_moves_an_incomplete_body(top):
    clap = sample("clap")  # hands in front, so that arms do not point down like legs
    body = part(clap, top)
    result = retarget(clap, body)
    assert result.world.up == "Y"
    found, expected = (motion.positions - motion.positions[:, :1] for motion in (result.motion, body))
    assert_near(found, expected)


def test_legs_alone_show_left_and_right():
    body = part(short_walk(), without=("Chest",)).skeleton
    other = {"Left": "Right", "Righ": "Left"}
    names = (other[name[:4]] + name.removeprefix("Left").removeprefix("Right") for name in body.names[1:])
    wrong = replace(body, names=(body.names[0], *names))
    target = rig("mixamo", "T")
    for joint, driver in enumerate(find_matching(body_of(wrong), body_of(target)).drivers):
        if driver > 0:
            assert body.names[driver][0] == target.names[joint].removeprefix("mixamorig:")[0]


JOINTS = {"mixamo": 65, "xsens": 23, "lafan1": 22, "unreal": 68}
UPPER_ARM = {"mixamo": "mixamorig:LeftArm", "xsens": "LeftShoulder", "lafan1": "LeftArm", "unreal": "upperarm_l"}
FOREARM = {"mixamo": "mixamorig:LeftForeArm", "xsens": "LeftElbow", "lafan1": "LeftForeArm", "unreal": "lowerarm_l"}
HAND = {"mixamo": "mixamorig:LeftHand", "xsens": "LeftWrist", "lafan1": "LeftHand", "unreal": "hand_l"}
SIDE = re.compile(r"Left|Right|_[lr](?=_|$)")
OTHER = {"Left": "Right", "Right": "Left", "_l": "_r", "_r": "_l"}

poses = pytest.mark.parametrize("pose", RIG_POSES)


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
    assert len([*RIGS.iterdir()]) == len(CONVENTIONS) * len(RIG_POSES)


@conventions
@poses
def test_a_rig_is_whole_and_symmetric_and_stands_on_the_floor(convention, pose):
    skeleton = rig(convention, pose)
    assert (skeleton.units, skeleton.up) == ("cm", "Z" if convention == "unreal" else "Y")
    assert np.sum(~skeleton.end_sites) == JOINTS[convention]
    short = [skeleton.names[joint] for joint in np.flatnonzero(skeleton.lengths[1:] < 0.4) + 1]
    assert all(name.startswith("ik_") for name in short)
    places = standing(skeleton)
    for name, place in places.items():
        twin = SIDE.sub(lambda side: OTHER[side.group()], name)
        if name != "ik_hand_gun":
            np.testing.assert_allclose(places[twin], place * (-1, 1, 1), atol=1e-5)
        if "Left" in name or name.endswith("_l"):
            assert place[0] > 0
    assert 160 < max(place[1] for place in places.values()) < 190
    (ankle, toe), _ = feet(skeleton)
    assert 7 < places[ankle][1] < 9
    assert 1 < places[toe][1] < 4
    ahead = places[toe] - places[ankle]
    assert ahead[2] > 4 * abs(ahead[0])
    assert ahead[2] > 2 * -ahead[1] > 0


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
