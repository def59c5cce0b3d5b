"""Spines and necks of different numbers of joints follow one another smoothly."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import posed
from scipy.spatial.transform import Rotation
from test_conventions import tree

from distretarget import Skeleton, retarget
from distretarget.conventions import by_names
from distretarget.matching import find_matching
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
TRUNK, NAPE = 50.0, 12.0  # how long spine and neck are, whatever joints they have [cm]

numbers = pytest.mark.parametrize("theirs", NUMBERS)
others = pytest.mark.parametrize("ours", NUMBERS)


def person(joints, neck=1, uneven=0.0, spine="Spine", nape="Neck"):
    """A person with so many joints in spine and neck, whose spine's bones grow upwards by a part `uneven` each."""
    spine = [f"{spine}{k}" for k in range(joints)]
    necks = [f"{nape}{k}" for k in range(neck)]
    arms = "|".join(">".join(f"{side}{part}" for part in list(LIMBS)[:4]) for side in ("Left", "Right"))
    legs = "|".join(">".join(f"{side}{part}" for part in list(LIMBS)[4:]) for side in ("Left", "Right"))
    body = tree(f"Hips({'>'.join(spine)}({'>'.join([*necks, 'Head'])}|{arms})|{legs})")
    bones = np.cumprod(np.full(joints, 1.0 + uneven))
    offsets = dict(zip(spine[1:] + necks[:1], ([0, bone, 0] for bone in TRUNK * bones / bones.sum()), strict=True))
    offsets |= dict.fromkeys([*necks[1:], "Head"], [0, NAPE / neck, 0]) | {"Hips": [0, 95, 0], spine[0]: [0, 8, 0]}
    for part, offset in LIMBS.items():
        offsets |= {"Left" + part: offset, "Right" + part: np.multiply(offset, [-1, 1, 1])}
    channels = tuple((POSITION_CHANNELS if name == "Hips" else ()) + ROTATION_CHANNELS for name in body.names)
    return replace(body, offsets=np.array([offsets[name] for name in body.names], float), channels=channels)


def target_person(joints, neck=1):
    """Another person, whose spine and neck have other names."""
    return person(joints, neck, spine="Back", nape="LowerNeck")


def chain(body, name):
    return [joint for joint, other in enumerate(body.names) if other.startswith(name)]


def places(matching, joints, drivers):
    """Where along the source's chain each joint's turn is taken, from 0 for its first joint."""
    turns = [[drivers.index(driver) for driver in pair] for pair in matching.turns[joints]]
    return np.array([a + share * (b - a) for (a, b), share in zip(turns, matching.shares[joints], strict=True)])


def bends(motion, joints):
    """(joints,), how far each joint of a chain turns from the one above in the last frame [degrees]."""
    return np.degrees(Rotation.from_quat(motion.rotations[-1, joints]).magnitude())


def bent(body, name, degrees):
    """The chain bent forwards by so many degrees in all, evenly over its joints."""
    joints = chain(body, name)
    turns = {body.names[joint]: np.radians([[0, 0, 0], [degrees / len(joints), 0, 0]]) for joint in joints}
    return posed(body, turns, np.tile(body.offsets[0], (2, 1)))


@numbers
@others
@pytest.mark.parametrize("uneven", [0.0, 0.4])
def test_shares_grow_along_the_chain_between_neighbours(theirs, ours, uneven):
    source, target = person(theirs, uneven=uneven), target_person(ours)
    matching = find_matching(source, target)
    joints, drivers = chain(target, "Back"), chain(source, "Spine")
    along = places(matching, joints, drivers)
    assert np.all(np.diff(along) > 0) or theirs == 1 or ours > theirs
    assert np.all(np.diff(along) >= 0)
    assert np.all((matching.shares >= 0) & (matching.shares <= 1))
    pairs = np.diff([[drivers.index(driver) for driver in pair] for pair in matching.turns[joints]])
    assert set(pairs.flat) <= {0, 1}
    if ours > theirs:
        assert (along[0], along[-1]) == (0, theirs - 1)


@pytest.mark.parametrize("count", NUMBERS)
def test_chains_of_as_many_joints_go_one_to_one(count):
    source, target = person(count, neck=2, uneven=0.5), person(count, neck=2)
    matching = find_matching(source, target)
    drivers = np.arange(len(target))
    np.testing.assert_array_equal(matching.turns, np.stack([drivers, drivers], axis=1))
    np.testing.assert_array_equal(matching.shares, 0)


def test_five_joints_over_three_and_three_over_five():
    three, five = person(3), person(5)
    found = places(find_matching(three, five), chain(five, "Spine"), chain(three, "Spine"))
    np.testing.assert_allclose(found, [0, 0.4, 1, 1.6, 2], atol=1e-12)
    found = places(find_matching(five, three), chain(three, "Spine"), chain(five, "Spine"))
    np.testing.assert_allclose(found, [1 / 3, 2, 11 / 3], atol=1e-12)


def test_one_joint_turns_all_three_and_three_turn_one_by_the_middle():
    one, three = person(1), person(3)
    matching = find_matching(one, three)
    np.testing.assert_array_equal(matching.turns[chain(three, "Spine")], one.index("Spine0"))
    matching = find_matching(three, one)
    np.testing.assert_allclose(places(matching, chain(one, "Spine"), chain(three, "Spine")), [1])


@numbers
@others
def test_an_evenly_bent_spine_stays_evenly_bent(theirs, ours):
    source, target = person(theirs), target_person(ours)
    result = retarget(bent(source, "Spine", 60), target).motion
    joints, drivers = chain(target, "Back"), chain(source, "Spine")
    known = bends(bent(source, "Spine", 60), drivers)
    bend = bends(result, joints)
    last = Rotation.from_quat(result.world_rotations[-1, joints[-1]]).magnitude()
    assert np.degrees(last) == pytest.approx(bend.sum(), abs=0.1)
    # The ends of a longer chain turn as those of the shorter one; those of a shorter one as what lies in their middles.
    if ours >= theirs:
        assert bend.sum() == pytest.approx(60, abs=0.1)
    assert bend.max() <= max(known.max(), 60 / ours) * 1.35 + 0.1
    assert ends_turn(result.positions, target, ours) == pytest.approx(
        ends_turn(bent(source, "Spine", 60).positions, source, theirs), abs=5 if min(theirs, ours) > 1 else 31
    )


def ends_turn(x, body, joints):
    """By how much the line from the lowest joint of the spine to the neck turns from the first frame to the last."""
    line = x[:, body.index("Neck0")] - x[:, body.index("Spine0")]
    assert joints == len(chain(body, "Spine"))
    return np.degrees(np.arccos(np.dot(line[0], line[-1]) / np.linalg.norm(line, axis=1).prod()))


@pytest.mark.parametrize("theirs", [1, 2, 3])
@pytest.mark.parametrize("ours", [1, 2, 3])
def test_necks_too(theirs, ours):
    source, target = person(3, neck=theirs), person(4, neck=ours)
    motion = bent(source, "Neck", 40)
    result = retarget(motion, target).motion
    for name in ("Head", "Hips"):
        np.testing.assert_allclose(
            result.world_rotations[:, target.index(name)], motion.world_rotations[:, source.index(name)], atol=1e-3
        )
    assert bends(result, chain(target, "Neck")).max() <= 40 / min(theirs, ours) + 0.1


def test_given_pairs_stay_as_they_are():
    source, target = person(3), person(5)
    matching = find_matching(source, target, {"Spine1": "Spine2", "Spine3": None})
    given, none = target.index("Spine1"), target.index("Spine3")
    np.testing.assert_array_equal(matching.turns[given], source.index("Spine2"))
    assert matching.shares[given] == 0
    np.testing.assert_array_equal(matching.turns[none], -1)
    plain = find_matching(source, target)
    rest = [joint for joint in range(len(target)) if joint not in (given, none)]
    np.testing.assert_array_equal(matching.turns[rest], plain.turns[rest])
    np.testing.assert_array_equal(matching.shares[rest], plain.shares[rest])


def test_a_spine_without_lengths_is_spread_evenly():
    source, target = person(3), person(5)
    flat = np.where(np.char.startswith(target.names, "Spine")[:, None], 0.0, target.offsets)
    flat[target.index("Neck0")] = 0.0
    matching = find_matching(source, Skeleton(target.names, target.parents, flat, target.channels, target.end_sites))
    found = places(matching, chain(target, "Back"), chain(source, "Spine"))
    np.testing.assert_allclose(found, [0, 0.4, 1, 1.6, 2], atol=1e-12)
