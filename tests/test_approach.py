"""Hands above a head in the source are not in the middle of a large head, but on the source's side of it."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from bodies import sample_target

from distretarget import Body, Motion
from distretarget.body.build import capsules_by_build
from distretarget.objectives.approach import HEAD, with_hands_on_source_side
from distretarget.objectives.body_skin import BodySkin, Skins
from distretarget.skin.limbs import bent, reaching

BODY = Body.of(sample_target("hero").skeleton)
# From the middle of the head to the left hand: up, up and forwards, up and to the left, to the left and back.
SIDES = np.array([[0.0, 1.0, 0.0], [0.1, 0.8, 0.6], [0.5, 0.8, 0.1], [0.8, 0.4, -0.3]])


@cache
def skin(head=1.0):
    """The average skin of the body, with a head larger by a factor."""
    capsules = capsules_by_build(BODY)
    factors = np.where(capsules.segments == HEAD, head, 1.0)[:, None]
    middles = capsules.ends.mean(axis=1, keepdims=True)
    ends = middles + factors[..., None] * (capsules.ends - middles)
    return BodySkin.of(BODY, replace(capsules, ends=ends, radii=factors * capsules.radii))


def radius(body):
    return float(body.capsules.radii[body.capsules.segments == HEAD].mean())


def ways(body, motion):
    """From the middle of the head to the left hand, (frames, 3)."""
    ends, limb = body.posed(motion), body.limbs[0]
    hand = body.centres(ends, body.of_joint[limb.end]).mean(axis=1)
    return body.unit * (hand - ends[:, body.capsules.segments == HEAD].mean(axis=(1, 2)))


@cache
def overhead():
    """A frame for each of `SIDES`, with the left hand near the middle of the head of the average body."""
    body, frames = skin(), len(SIDES)
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (frames, len(BODY.skeleton), 1))
    still = Motion(BODY.skeleton, np.tile(BODY.skeleton.rest_positions[0], (frames, 1)), rotations, "0.1")
    wanted = 1.4 * radius(body) * SIDES / np.linalg.norm(SIDES, axis=1, keepdims=True)
    moved = np.zeros((frames, len(body.limbs), 2, 3))
    moved[:, 0] = reaching(still, body.limbs[0], wanted - ways(body, still), np.zeros_like(wanted))
    return bent(still, body.limbs, moved)


def brought(target, free=1.0):
    clip = SimpleNamespace(source=overhead(), averaged=lambda values, _: values, widened=lambda values, _: values)
    free = np.full((len(SIDES), len(target.limbs)), free)
    return with_hands_on_source_side(clip, Skins(skin(), target), overhead(), free)


def test_a_hand_in_a_large_head_goes_to_the_sources_side_and_out_as_far_as_it_reaches():
    large = skin(4.0)
    before, after, source = ways(large, overhead()), ways(large, brought(large)), ways(skin(), overhead())
    far, at_last, wanted = (np.linalg.norm(each, axis=1) for each in (before, after, source))
    assert (far < 0.7 * radius(large)).all()
    assert (at_last > 1.25 * far).all()
    assert (at_last < radius(large) + wanted - radius(skin()) + 1e-9).all()
    assert ((after * source).sum(axis=1) > np.cos(np.radians(30.0)) * at_last * wanted).all()


def test_a_hand_that_cannot_move_and_the_same_body_stay_as_they_are():
    for result in (brought(skin(4.0), free=0.0), brought(skin())):
        np.testing.assert_allclose(result.positions, overhead().positions, atol=1e-9)


def centres(body, motion):
    """The middles of the left and of the right hand, (2, frames, 3)."""
    ends = body.posed(motion)
    return body.unit * np.array([body.centres(ends, body.of_joint[limb.end]).mean(axis=1) for limb in body.limbs[:2]])


def with_hands(motion, at):
    """The motion with the middles of the two hands at places, (2, 3)."""
    body = skin()
    for _ in range(20):  # hands turn with their forearms
        moved = np.zeros((len(motion), len(body.limbs), 2, 3))
        for number, way in enumerate(at[:, None] - centres(body, motion)):
            moved[:, number] = reaching(motion, body.limbs[number], way, np.zeros_like(way))
        motion = bent(motion, body.limbs, moved)
    return motion


def clapping(apart, passed, unit=1.0):
    """Hands so many of their radii off the middle between them in a source, in the copy, and as they are brought; the
    source in another unit.
    """
    body, still = skin(), overhead()
    radii = [body.balls.radii[body.balls_of(body.of_joint[limb.end])].mean() for limb in body.limbs[:2]]
    left = body.unit * float(np.mean(radii)) * np.array([1.0, 0.0, 0.0])
    front = still.positions[0, body.limbs[0].top] * [0.0, 1.0, 1.0] + [0.0, 0.0, 0.25 * body.unit]
    source, copy = (with_hands(still, front + far * np.array([left, -left])) for far in (apart, passed))
    scaled = source.scaled(unit)
    of_source = Body.of(scaled.skeleton)
    skins = Skins(BodySkin.of(of_source, capsules_by_build(of_source)), body)
    clip = SimpleNamespace(source=scaled, averaged=lambda values, _: values, widened=lambda values, _: values)
    return source, copy, with_hands_on_source_side(clip, skins, copy, np.ones((len(copy), len(body.limbs))))


@pytest.mark.parametrize("unit", [2.0**-7, 2.0**7])
def test_hands_go_to_the_same_place_whatever_the_unit_of_the_source(unit):
    _, copy, result = clapping(1.5, -0.8)
    assert not np.allclose(result.positions, copy.positions, atol=1e-3)
    np.testing.assert_allclose(clapping(1.5, -0.8, unit)[-1].positions, result.positions, atol=1e-9)


@pytest.mark.parametrize(
    ("apart", "passed", "moves"),
    [(1.0, -0.8, True), (1.0, 0.2, True), (1.0, 1.0, False), (3.5, -0.8, False)],
    ids=["passed each other", "deep in each other", "as in the source", "apart in the source"],
)
def test_hands_that_touch_are_on_the_sides_on_which_the_source_has_them(apart, passed, moves):
    source, copy, result = clapping(apart, passed)
    body = skin()
    wanted = centres(body, source if moves else copy)
    (found, other), (left_hand, right_hand) = centres(body, result), wanted
    hand = np.linalg.norm(np.subtract(*centres(body, source)), axis=1).min() / (2.0 * apart)
    np.testing.assert_allclose(found - other, left_hand - right_hand, atol=0.5 * hand)
