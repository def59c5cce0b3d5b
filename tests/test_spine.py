"""Spines and necks with different numbers of joints drive each other smoothly."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import body_of, posed
from named_bodies import tree
from scipy.spatial.transform import Rotation

from distretarget import retarget
from distretarget.matching.matching import find_matching
from distretarget.skeleton import POSITION_CHANNELS, ROTATION_CHANNELS

NUMBERS = (1, 2, 3, 4, 5, 7)
LIMBS = {
    "Shoulder": (4, 6, 0),
    "Arm": (13, 0, 0),
    "ForeArm": (28, 0, 0),
    "Hand": (26, 0, 0),
    "UpLeg": (9, -6, 0),
    "Leg": (0, -42, 1),
    "Foot": (0, -41, -2),
    "ToeBase": (0, -6, 14),
}
TRUNK, NAPE = 50.0, 12.0  # lengths of spine and neck, whatever their joints [cm]

numbers = pytest.mark.parametrize("source_joints", NUMBERS)
others = pytest.mark.parametrize("target_joints", NUMBERS)


def person(joints, neck=1, uneven=0.0, spine="Spine", nape="Neck"):
    """A person with this many joints in spine and neck; each bone of the spine is longer than the one below by the
    factor 1 + `uneven`.
    """
    spine = [f"{spine}{k}" for k in range(joints)]
    necks = [f"{nape}{k}" for k in range(neck)]
    arms = "|".join(">".join(f"{side}{part}" for part in list(LIMBS)[:4]) for side in ("Left", "Right"))
    legs = "|".join(">".join(f"{side}{part}" for part in list(LIMBS)[4:]) for side in ("Left", "Right"))
    body = tree(f"Hips({'>'.join(spine)}({'>'.join([*necks, 'Head'])}|{arms})|{legs})")
    bones = np.cumprod(np.full(joints, 1.0 + uneven))
    offsets = dict(zip(spine[1:] + necks[:1], ([0, bone, 0] for bone in TRUNK * bones / bones.sum()), strict=True))
    offsets |= dict.fromkeys([*necks[1:], "Head"], (0, NAPE / neck, 0)) | {"Hips": [0, 95, 0], spine[0]: [0, 8, 0]}
    for part, offset in LIMBS.items():
        offsets |= {"Left" + part: offset, "Right" + part: np.multiply(offset, [-1, 1, 1])}
    channels = tuple((POSITION_CHANNELS if name == "Hips" else ()) + ROTATION_CHANNELS for name in body.names)
    return replace(body, offsets=np.array([offsets[name] for name in body.names], float), channels=channels)


def other_person(joints, neck=1):
    """A person whose joints of spine and neck have other names."""
    return person(joints, neck, spine="Back", nape="Nape")


def chain(body, name):
    return [joint for joint, other in enumerate(body.names) if other.startswith(name)]


def found_matching(source, target, joint_map=None):
    return find_matching(body_of(source), body_of(target), joint_map)


def places(matching, joints, drivers):
    """(joints,), from where on the source's chain each joint takes its rotation; 0 is the first joint."""
    turns = [[drivers.index(driver) for driver in pair] for pair in matching.rotation_sources[joints]]
    return np.array([a + share * (b - a) for (a, b), share in zip(turns, matching.blend[joints], strict=True)])


def bends(motion, joints):
    """(joints,), how far each joint of a chain turns from the one above in the last frame [degrees]."""
    return np.degrees(Rotation.from_quat(motion.rotations[-1, joints]).magnitude())


def line_turns(motion, lower, upper):
    """By how much the line between two joints turns from the first frame to the last [degrees]."""
    line = motion.positions[:, motion.skeleton.index(upper)] - motion.positions[:, motion.skeleton.index(lower)]
    return np.degrees(np.arccos(line[0] @ line[-1] / np.linalg.norm(line, axis=1).prod()))


def bent(body, name, degrees):
    """The chain bent forwards by this angle in total [degrees], spread evenly over its joints."""
    joints = chain(body, name)
    turns = {body.names[joint]: np.radians([[0, 0, 0], [degrees / len(joints), 0, 0]]) for joint in joints}
    return posed(body, turns, np.tile(body.offsets[0], (2, 1)))


@pytest.mark.parametrize("count", NUMBERS)
def test_chains_of_as_many_joints_go_one_to_one(count):
    source, target = person(count, neck=2, uneven=0.5), person(count, neck=2)
    matching = found_matching(source, target)
    drivers = np.arange(len(target))
    np.testing.assert_array_equal(matching.rotation_sources, np.stack([drivers, drivers], axis=1))
    np.testing.assert_array_equal(matching.blend, 0)


def test_known_numbers_of_joints_are_spread_evenly():
    three, five = person(3), other_person(5)
    found = places(found_matching(three, five), chain(five, "Back"), chain(three, "Spine"))
    np.testing.assert_allclose(found, [0, 0.4, 1, 1.6, 2], atol=1e-12)
    three, five = other_person(3), person(5)
    found = places(found_matching(five, three), chain(three, "Back"), chain(five, "Spine"))
    np.testing.assert_allclose(found, [1 / 3, 2, 11 / 3], atol=1e-12)
    one, three = person(1), other_person(3)
    np.testing.assert_array_equal(
        found_matching(one, three).rotation_sources[chain(three, "Back")], one.index("Spine0")
    )
    one, three = other_person(1), person(3)
    np.testing.assert_allclose(places(found_matching(three, one), chain(one, "Back"), chain(three, "Spine")), [1])
    source, target = person(3), other_person(5)
    offsets = np.array(target.offsets)
    offsets[[*chain(target, "Back"), target.index("Nape0")]] = 0.0
    matching = found_matching(source, target.with_offsets(offsets))
    found = places(matching, chain(target, "Back"), chain(source, "Spine"))
    np.testing.assert_allclose(found, [0, 0.4, 1, 1.6, 2], atol=1e-12)


@numbers
@others
def test_an_evenly_bent_spine_stays_evenly_bent(source_joints, target_joints):
    source, target = person(source_joints), other_person(target_joints)
    motion = bent(source, "Spine", 60)
    result = retarget(motion, target).motion
    bend = bends(result, chain(target, "Back"))
    assert bend.max() < 60 / min(source_joints, target_joints) + 0.1
    assert bend.min() > 0.4 * bend.max() or source_joints <= target_joints
    assert line_turns(result, "Back0", "Nape0") == pytest.approx(line_turns(motion, "Spine0", "Neck0"), abs=0.5)
    for name in ("Hips", "Nape0", "LeftShoulder"):
        joint = source.index(name.replace("Nape", "Neck"))
        found, expected = result.world_rotations[-1, target.index(name)], motion.world_rotations[-1, joint]
        np.testing.assert_allclose(found, expected, atol=1e-3)


@pytest.mark.parametrize(("source_joints", "target_joints"), [(2, 5), (5, 3), (7, 4)])
def test_equal_names_do_not_cut_the_bend_off(source_joints, target_joints):
    source, target = person(source_joints), person(target_joints)
    motion = bent(source, "Spine", 60)
    result = retarget(motion, target).motion
    assert line_turns(result, "Spine0", "Neck0") == pytest.approx(line_turns(motion, "Spine0", "Neck0"), abs=0.5)


@pytest.mark.parametrize("source_joints", [1, 2, 3])
@pytest.mark.parametrize("target_joints", [1, 2, 3])
def test_necks_too(source_joints, target_joints):
    source, target = person(3, neck=source_joints), other_person(4, neck=target_joints)
    motion = bent(source, "Neck", 40)
    result = retarget(motion, target).motion
    assert bends(result, chain(target, "Nape")).max() < 40 / min(source_joints, target_joints) + 0.1
    assert line_turns(result, "Nape0", "Head") == pytest.approx(line_turns(motion, "Neck0", "Head"), abs=0.5)
    np.testing.assert_allclose(bends(result, chain(target, "Back")), 0, atol=0.1)


def test_given_pairs_stay_as_they_are():
    source, target = person(3), other_person(5)
    matching, plain = found_matching(source, target, {"Back1": "Spine2", "Back3": None}), found_matching(source, target)
    given, none = target.index("Back1"), target.index("Back3")
    np.testing.assert_array_equal(matching.rotation_sources[given], source.index("Spine2"))
    np.testing.assert_array_equal(matching.rotation_sources[none], -1)
    np.testing.assert_array_equal(matching.blend[[given, none]], 0)
    rest = [joint for joint in range(len(target)) if joint not in (given, none)]
    np.testing.assert_array_equal(matching.rotation_sources[rest], plain.rotation_sources[rest])
    np.testing.assert_array_equal(matching.blend[rest], plain.blend[rest])
