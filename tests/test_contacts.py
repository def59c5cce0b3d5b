"""Contacts of regions of the body, whose errors are known by construction, and places on the body."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import ALONG, PERSON, UP, clapping, lengthened, matched, posed, standing, tree_of, turned
from scipy.spatial.transform import Rotation

from distretarget import Skeleton
from distretarget.body.body import Body
from distretarget.measure.comparison import Reference
from distretarget.measure.contacts import STRIDE, Candidates, Contacts, find_region_contacts
from distretarget.measure.metrics import BY_KEY
from distretarget.measure.skin import difference, find_part_frames
from distretarget.skin.capsules import SEGMENTS

FEET_TOGETHER = {"LeftKnee": np.array([0, 0, -0.1]), "RightKnee": np.array([0, 0, 0.1])}


def hook(last, frames=2, links=3):
    """Two limbs of a body without anatomy whose tips meet, if the last bone of the second has length 1."""
    way = [(0.0, 1.0, 0.0), (1.0 - last, 0.0, 0.0)] if links == 2 else [(0, 1.0, 0), (0.5, 0, 0), (last - 0.5, 0, 0)]
    first = [(1.0, 0.0, 0.0)] if links == 2 else [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]
    offsets = np.array([(0.0, 0.0, 0.0), *first, *way])
    parents = [-1, *range(len(first)), 0, *range(len(first) + 1, len(offsets) - 1)]
    names = ["root", *(f"a{k}" for k in range(len(first))), *(f"b{k}" for k in range(len(way)))]
    return posed(tree_of(offsets, names, parents), {}, np.zeros((frames, 3)))


def contacts_of(source, result, rest=()):
    """The contacts of two motions; `rest` is whether both feet rest in each frame."""
    feet_rest = np.repeat(np.array(rest, bool)[:, None], 2, axis=1) if len(rest) else np.zeros((len(source), 0), bool)
    return find_region_contacts(source, matched(source.rigid_skeleton, result.skeleton), feet_rest).in_result(result)


def names_of(contacts):
    return [touch.name for touch in contacts.touches]


def test_the_error_of_a_contact_is_that_of_the_nearest_joints():
    """Of the limbs, the tips coincide; the joint before the tip is near as well, and does not count."""
    contacts = contacts_of(hook(1.0), hook(1.4))
    (touch,) = contacts.touches
    assert touch.name == "a0 - b0"
    np.testing.assert_array_equal(contacts.counts, 1)
    np.testing.assert_allclose(contacts.track.values, 0.4 / 4.4)
    assert (touch.distance_source, touch.distance_result) == pytest.approx((0, 0.4 / 4.4))
    assert (touch.u, touch.v) == (2, 5)
    assert names_of(contacts_of(hook(0.0, links=2), hook(0.0, links=2))) == []


def test_contact_error_is_the_mean_over_the_contacts_of_a_frame_then_over_frames():
    none, ends = np.zeros(0, np.intp), {"u": np.array([1, 2, 3]), "v": np.array([4, 5, 6])}
    candidates = Candidates(
        names=("hand - head", "hand - hips"),
        passing=np.zeros(2, bool),
        first=none,
        **ends,
        tau=np.ones(3),
        tau_source=np.ones(3),
        limits=none,
    )
    contacts = Contacts(
        candidates=candidates,
        strides=np.zeros(3, bool),
        frame=np.array([0, 0, 2]),
        regions=np.array([0, 1, 1]),
        nearest=np.arange(3),
        distance_source=np.zeros(3),
        distance_result=np.array([0.1, 0.3, 0.6]),
    )
    np.testing.assert_array_equal(contacts.counts, [2, 0, 1])
    np.testing.assert_allclose(contacts.track.values, [0.2, 0, 0.6])
    head, hips = contacts.touches
    assert (head.name, head.error, head.worst_frame) == ("hand - head", pytest.approx(0.1), 0)
    assert (hips.error, hips.worst_frame, hips.u, hips.v) == (pytest.approx(0.45), 2, 3, 6)
    assert BY_KEY["contact_error"].of_clip({"contact_error": contacts.track}) == pytest.approx(0.4)


def test_a_clap_is_a_contact_of_the_hands_and_comes_first():
    source = clapping(np.array([0, 1, 1, 0.0]))
    longer = posed(lengthened(PERSON, {"Elbow": 1.3}), {}, source.root_positions)
    result = replace(longer, rotations=source.rotations)
    contacts = contacts_of(source, result)
    hands = contacts.touches[0]
    assert hands.name == "left hand - right hand"
    np.testing.assert_array_equal(hands.frames, [1, 2])
    wrists = [PERSON.index(f"{side}Wrist") for side in ("Left", "Right")]
    assert {hands.u, hands.v} <= {joint for wrist in wrists for joint in PERSON.subtree(wrist)}
    tau = result.skeleton.paths_from(hands.u)[hands.v]
    gap = np.linalg.norm(result.positions[hands.worst_frame, hands.u] - result.positions[hands.worst_frame, hands.v])
    assert hands.distance_result == pytest.approx(gap / tau)


def test_feet_touch_unless_both_rest():
    """The feet are nearer to each other all the time than while the person stands."""
    source, frames = standing(FEET_TOGETHER, 60), np.arange(60)
    assert names_of(contacts_of(source, source, frames >= 0)) == []
    contacts = contacts_of(source, source, frames < 20)
    assert names_of(contacts) == ["left foot - right foot"]
    np.testing.assert_array_equal(contacts.counts, frames > 19 + round(STRIDE / source.frame_time))


@pytest.mark.parametrize(("speed", "feet_touch"), [(0.1, False), (2.0, True)])
def test_feet_of_a_person_carried_fast_do_not_rest(speed, feet_touch):
    source = standing(FEET_TOGETHER, 30, np.outer(np.arange(30) * 0.02 * speed, ALONG))
    assert bool(Reference(source, matched(PERSON, PERSON), UP).compare(source).contacts.touches) == feet_touch


def test_regions_of_a_hand_make_no_contact_with_each_other():
    """A fist: the tip of a finger at the wrist, five joints along the tree."""
    joints = [("LeftFinger", "LeftWrist", (0.05, 0, 0)), ("LeftFinger2", "LeftFinger", (0.05, 0, 0))]
    joints += [("LeftFinger3", "LeftFinger2", (0.05, 0, 0)), ("LeftFinger4", "LeftFinger3", (0.05, 0, 0))]
    names, parents, offsets = list(PERSON.names), PERSON.parents.tolist(), PERSON.offsets.tolist()
    for name, parent, offset in joints:
        parents.append(names.index(parent))
        names.append(name)
        offsets.append(offset)
    body = Skeleton(
        names=tuple(names),
        parents=parents,
        offsets=offsets,
        channels=(*PERSON.channels, *[("Zrotation", "Xrotation", "Yrotation")] * 4),
        end_sites=[*PERSON.end_sites, *[False] * 4],
    )
    apart = {"LeftHip": np.array([0, 0, 0.5]), "RightHip": np.array([0, 0, -0.5])}
    curl = dict.fromkeys((name for name, *_ in joints[:3]), np.array([0, 0, np.pi / 2]))
    fist = posed(body, apart | curl, np.zeros((2, 3)) + UP)
    wrist, tip = body.index("LeftWrist"), body.index("LeftFinger4")
    assert body.path_sizes(np.array([wrist, tip]))[0, 1] == 5
    assert np.linalg.norm(fist.positions[0, wrist] - fist.positions[0, tip]) < 0.15 * body.paths_from(wrist)[tip]
    assert names_of(contacts_of(fist, fist)) == []


ROLES = Body.of(PERSON).anatomy.roles
CHEST = np.array([SEGMENTS.index("chest")])


def on_chest(skeleton, angle, out):
    """A place half way up the trunk, at an angle from the front to the left, `out` from the middle."""
    rest = skeleton.rest_positions
    hips, arms = (
        rest[[ROLES[f"{side}{limb}"] for side in ("left", "right")]].mean(axis=0) for limb in ("UpperLeg", "UpperArm")
    )
    return 0.5 * (hips + arms) + out * np.array([np.sin(angle), 0.0, np.cos(angle)])


@pytest.mark.parametrize("angle", [0.0, 0.7, -1.5, 3.0])
def test_places_on_the_trunk_are_known(angle):
    frames = find_part_frames(Body.of(PERSON))
    along, round_, away = frames.coordinates(CHEST, on_chest(PERSON, angle, 0.15)[None])[0]
    np.testing.assert_allclose([along, abs(round_)], [0.5, abs(angle)], atol=0.05)
    np.testing.assert_allclose(away * frames.lengths[0], 0.15, atol=0.01)


def test_left_and_right_are_opposite_and_the_front_is_between():
    frames = find_part_frames(Body.of(PERSON))
    left, front, right = (
        frames.coordinates(CHEST, on_chest(PERSON, angle, 0.15)[None])[0, 1] for angle in (1.0, 0.0, -1.0)
    )
    assert left * right < 0
    assert abs(front) < 0.05
    hand = np.array([SEGMENTS.index("left hand")])
    assert np.isnan(find_part_frames(Body.of(PERSON)).coordinates(hand, np.zeros((1, 3)))).all()


def test_another_size_and_other_axes_change_nothing():
    own = find_part_frames(Body.of(PERSON)).coordinates(CHEST, on_chest(PERSON, 0.7, 0.15)[None])
    large = PERSON.with_offsets(3.0 * PERSON.offsets)
    scaled = find_part_frames(Body.of(large)).coordinates(CHEST, on_chest(large, 0.7, 0.45)[None])
    np.testing.assert_allclose(scaled, own, atol=1e-9)
    turn = Rotation.from_euler("X", 90, degrees=True)
    other = turned(PERSON, turn)
    there = turn.apply(on_chest(PERSON, 0.7, 0.15))
    np.testing.assert_allclose(find_part_frames(Body.of(other)).coordinates(CHEST, there[None]), own, atol=1e-6)


def test_differences_are_in_half_widths_and_go_the_short_way_round():
    source, result = np.array([[0.5, 3.0, 0.2]]), np.array([[0.6, -3.0, 0.25]])
    known = np.hypot(0.1 / 0.25, 2.0 * np.pi - 6.0)
    np.testing.assert_allclose(difference(source, result), [known])
    assert difference(source, source) == 0
