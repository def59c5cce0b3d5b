"""Hands above a head in the source are not in the middle of a large head, but on the source's side of it."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
from bodies import sample_target

from distretarget import Body, Motion
from distretarget.body.build import average_for
from distretarget.objectives.approach import HEAD, approached
from distretarget.objectives.body_skin import BodySkin, Skins
from distretarget.skin.limbs import bent, reaching

BODY = Body.of(sample_target("hero").skeleton)
# From the middle of the head to the left hand: up, up and forwards, up and to the left, to the left and back.
SIDES = np.array([[0.0, 1.0, 0.0], [0.1, 0.8, 0.6], [0.5, 0.8, 0.1], [0.8, 0.4, -0.3]])


@cache
def skin(head=1.0):
    """The average skin of the body, with a head larger by a factor."""
    capsules = average_for(BODY).on(BODY)
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
    return approached(clip, Skins(skin(), target), overhead(), np.full((len(SIDES), len(target.limbs)), free))


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
