"""Where on a body something touches it: the same place on another body has the same coordinates."""

import numpy as np
import pytest
from bodies import PERSON, turned
from scipy.spatial.transform import Rotation

from distretarget.body.body import Body
from distretarget.measure.part_frames import difference, find_part_frames
from distretarget.skin.capsules import SEGMENTS

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


def test_arms_have_no_places():
    hand = np.array([SEGMENTS.index("left hand")])
    assert np.isnan(find_part_frames(Body.of(PERSON)).coordinates(hand, np.zeros((1, 3)))).all()
