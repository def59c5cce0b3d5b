"""Limbs leave the bodies they are in: displacements of elbows and wrists, and arms that bend by them."""

import bodies
import numpy as np
import pytest
from bodies import PERSON
from capsule_bodies import capsule_surface, mesh_of
from scipy.spatial.transform import Rotation

from distretarget.body.body import Body
from distretarget.body.build import capsules_by_build
from distretarget.objectives.arm_overlap import ELBOW
from distretarget.objectives.body_skin import BodySkin
from distretarget.skin.balls import segment_gaps
from distretarget.skin.capsules import SEGMENTS, Capsules, gap_at, may_touch, write_axis
from distretarget.skin.displacement import displacements
from distretarget.skin.limbs import WRIST, bent

BODY = Body.of(PERSON)
SKIN = BodySkin.of(BODY, capsules_by_build(BODY))
HAND, BELLY = 0.03, 0.2  # radii


def skin_of(belly=BELLY):
    """Balls for the hands and one for the belly, about the middle of the trunk."""
    parts = {"left hand": "LeftWrist", "right hand": "RightWrist", "belly": "Chest"}
    joints = np.array([PERSON.index(joint) for joint in parts.values()])
    radii = np.array([[radius] * 2 for radius in (HAND, HAND, belly)])
    return BodySkin.of(BODY, Capsules(joints, np.zeros((3, 2, 3)), radii, np.array([*map(SEGMENTS.index, parts)])))


def gap_along(share, part, depth=0.01, radius=0.04):
    """The gap of the left forearm and a ball of a part of the body that is so deep in it at a share of its length."""
    wrist = PERSON.offsets[PERSON.index("LeftWrist")]
    joints = np.array([PERSON.index("LeftElbow"), PERSON.index("Chest")])
    ends, segments = np.array([[0.0 * wrist, wrist], 2 * [0.0 * wrist]]), ["left forearm", part]
    capsules = Capsules(joints, ends, np.full((2, 2), radius), np.array([*map(SEGMENTS.index, segments)]))
    skin, across = BodySkin.of(BODY, capsules), np.array([0.0, 1.0, 0.0])
    place = share * wrist + (2 * radius - depth) * across
    gaps = segment_gaps(skin.balls, np.array([[[0.0 * wrist, wrist], [place, place]]]) / skin.unit, 1.0)
    return gaps[0].min() * skin.unit


def test_a_body_and_its_mirror_image_touch_in_the_same_pairs():
    number = {name: SEGMENTS.index(name) for name in SEGMENTS}
    other = {"left": "right", "right": "left"}
    opposite = [number[" ".join(other.get(word, word) for word in name.split())] for name in SEGMENTS]
    pairs = {*map(tuple, SKIN.balls.pairs.tolist())}
    assert pairs == {(opposite[a], opposite[b]) for a, b in pairs}
    assert (number["left hand"], number["right hand"]) in pairs


@pytest.mark.parametrize("part", ["chest", "belly", "pelvis"])
def test_a_forearm_gives_way_to_the_trunk_at_the_elbow_and_not_at_the_wrist(part):
    assert gap_along(0.0, part) == pytest.approx(0.04 * ELBOW - 0.01)
    assert gap_along(1.0, part) == pytest.approx(-0.01)
    assert np.all(np.diff([gap_along(share, part, 0.0) for share in (0.0, 1 / 3, 2 / 3, 1.0)]) < 0)


def gap_of_hanging_arms(wide, meshed=True):
    """The least gap of hanging upper arms and forearms to a chest, a capsule that reaches so far to each side."""
    build, across = capsules_by_build(BODY), np.array([[[-wide, -0.05, 0.0], [wide, -0.05, 0.0]]])
    arms = build[np.isin(build.segments, [number for number, name in enumerate(SEGMENTS) if "arm" in name])]
    joint, segment = np.array([PERSON.index("Chest3")]), np.array([SEGMENTS.index("chest")])
    fields = zip(vars(arms).values(), (joint, across, np.array([[0.15, 0.15]]), segment), strict=True)
    skin = BodySkin.of(BODY, Capsules(*map(np.concatenate, fields)))
    skin = (
        skin.on_mesh(mesh_of([(int(joint[0]), capsule_surface(across[0], [0.15, 0.15]))]), PERSON) if meshed else skin
    )
    down = {f"{side}Shoulder": np.array([0.0, 0.0, turn]) for side, turn in (("Left", -1.57), ("Right", 1.57))}
    return segment_gaps(skin.balls, skin.posed(bodies.posed(PERSON, down, np.zeros((1, 3)))), 1.0).min()


@pytest.mark.parametrize(("wide", "overlaps"), [(0.01, False), (0.12, True), (0.2, False), (0.25, False)])
def test_arms_whose_shoulders_are_inside_the_chest_may_hang_in_it(wide, overlaps):
    """A shoulder is .23 m from the middle. Beside the second chest, which ends before it, arms have to give way."""
    assert (gap_of_hanging_arms(wide) < -0.02) == overlaps


def test_arms_do_not_hang_in_a_chest_whose_thickness_is_a_guess():
    assert gap_of_hanging_arms(0.2, meshed=False) < -0.03


@pytest.mark.parametrize("part", ["head", "left thigh"])
def test_a_forearm_does_not_give_way_to_other_parts(part):
    assert gap_along(0.0, part) == gap_along(1.0, part) == pytest.approx(-0.01)


def test_balls_that_are_nearer_may_touch_and_most_others_may_not():
    rng, axis, nearer, left_out = np.random.default_rng(1), np.zeros(8), 0, 0
    for ball, ends, radii in zip(rng.random((500, 4)), rng.random((500, 2, 3)), rng.random((500, 2)), strict=True):
        ball[3], radii[:] = 0.1 * ball[3], 0.2 * radii
        write_axis(ends, radii, axis)
        if gap_at(ball, ball[3], axis, radii)[0] < 0.05:
            assert may_touch(ball, axis, radii, 0.05)
            nearer += 1
        else:
            left_out += not may_touch(ball, axis, radii, 0.05)
    assert nearer > 50
    assert left_out > 0.8 * (500 - nearer)


def standing(turns, frames=1):
    return bodies.standing(turns, frames, height=0.9)


def displaced(skin, motion, ends=None, *, free=1.0):
    """The gaps and the displacements of a motion; `ends` are those of its capsules where they are elsewhere."""
    ends = skin.posed(motion) if ends is None else ends
    gaps = segment_gaps(skin.balls, ends, 0.2)
    x = motion.positions / skin.unit
    limbs = np.stack([x[:, [*limb.joints]] for limb in skin.limbs], axis=1)
    same, none = np.full((len(motion), len(skin.limbs), 2), free), np.zeros_like(gaps)
    return gaps, displacements(skin.balls, skin.displaced, ends, limbs, same, none)[0]


def gaps_of(skin, motion, d):
    moved = bent(motion, skin.limbs, d * skin.unit)
    return moved, segment_gaps(skin.balls, skin.posed(moved), 0.2)


def hand_in_belly(depth=0.1):
    """A pose in which the left hand is about so deep in the belly."""
    fold = {"LeftShoulder": [0, -1.2, 0], "LeftElbow": [0, -1.4, 0]}
    motion = standing(fold)
    wrist, chest = (motion.positions[0, PERSON.index(joint)] for joint in ("LeftWrist", "Chest"))
    return motion, skin_of(np.linalg.norm(wrist - chest) - HAND + depth)


@pytest.mark.parametrize("depth", [0.005, 0.03, 0.08])
def test_a_hand_that_is_inside_comes_out_and_no_farther(depth):
    motion, skin = hand_in_belly(depth)
    gaps, d = displaced(skin, motion)
    assert gaps.min() * skin.unit == pytest.approx(-depth, abs=1e-6)
    _, after = gaps_of(skin, motion, d)
    assert abs(after.min()) * skin.unit < 0.003


def test_a_hand_that_is_outside_stays_where_it_is():
    motion, skin = hand_in_belly(-0.05)
    assert not displaced(skin, motion)[1].any()
    motion, skin = hand_in_belly()
    assert not displaced(skin, motion, free=0.0)[1].any()


def through_a_hand(places):
    """The belly goes through the left hand, to places before it: the least gaps, the displacements of the hand, and how
    far before the belly these lead.
    """
    motion, _ = hand_in_belly()
    skin = skin_of(0.12)
    wrist = motion.positions[0, PERSON.index("LeftWrist")]
    many = standing({"LeftShoulder": [0, -1.2, 0], "LeftElbow": [0, -1.4, 0]}, len(places))
    ends = skin.posed(many)
    belly = skin.balls.of_capsule[SEGMENTS.index("belly")]
    ends[:, belly] = (wrist + np.outer(places, [0.0, 0.0, 1.0]))[:, None] / skin.unit
    gaps, d = displaced(skin, many, ends)
    ahead = wrist[2] / skin.unit + d[:, 0, 1, 2] - ends[:, belly, 0, 2]
    return gaps.min(axis=1), skin.unit * d[:, 0, 1], ahead


def test_a_hand_stays_on_the_side_on_which_it_entered():
    gaps, _, ahead = through_a_hand(np.linspace(-0.25, 0.05, 60))
    assert (ahead[gaps < -1e-3] > 0).all()
    places = [-0.25, -0.13, -0.08, -0.03, 0.02, 0.06, 0.09, 0.05, 0.01, -0.03, -0.08, -0.13]
    _, d, _ = through_a_hand(places)
    assert (np.linalg.norm(np.diff(d, axis=0), axis=1) < 1.25 * np.abs(np.diff(places))).all()


@pytest.mark.parametrize("angle", [0.1, 0.27, 1.5])
def test_an_arm_bends_to_where_its_joints_are_displaced_to(angle):
    motion = standing({"LeftShoulder": [0.3, -0.8, 0.2], "LeftElbow": [0, -0.9, 0.1]}, 3)
    skin = skin_of()
    shoulder, elbow, wrist = skin.limbs[0].joints
    turn = Rotation.from_rotvec(angle * np.array([0.37, 0.74, -0.56]))
    x = motion.positions
    d = np.zeros((3, len(skin.limbs), 2, 3))
    d[:, 0, 0] = turn.apply(x[:, elbow] - x[:, shoulder]) - (x[:, elbow] - x[:, shoulder])
    d[:, 0, 1] = d[:, 0, 0] + turn.inv().apply(x[:, wrist] - x[:, elbow]) - (x[:, wrist] - x[:, elbow])
    moved = bent(motion, skin.limbs, d)
    np.testing.assert_allclose(moved.positions[:, elbow], x[:, elbow] + d[:, 0, 0], atol=1e-12)
    np.testing.assert_allclose(moved.positions[:, wrist], x[:, wrist] + d[:, 0, 1], atol=1e-12)
    others = [joint for joint in range(len(PERSON)) if joint not in PERSON.subtree(shoulder)]
    np.testing.assert_allclose(moved.positions[:, others], x[:, others], atol=1e-12)
    hand, forearm = (_turn(moved, motion, joint) for joint in (wrist, elbow))
    assert (forearm * hand.inv()).magnitude() <= WRIST  # the wrist takes the forearm's turn as far as it can
    assert hand.magnitude() <= forearm.magnitude() * min((forearm.magnitude() / WRIST) ** 2, 1.0)


def _turn(moved, motion, joint):
    """How a joint has turned in the world in the first frame."""
    new, old = (Rotation.from_quat(each.world_rotations_of(joint)[0]) for each in (moved, motion))
    return new * old.inv()
