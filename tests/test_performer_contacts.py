"""The pairs of joints of two performers that touch, and the vectors that they are drawn to."""

from dataclasses import replace

import numpy as np
import pytest

from distretarget.baseline.rotation_copy import RootScale
from distretarget.objectives.activation import ContactSettings
from distretarget.scene.contacts import ContactPoints, find_performer_contacts

FRAMES = 5
UP = np.array([0.0, 1.0, 0.0])
BETWEEN = np.array([2.0, 1.0, 2.0])  # from the joint of the second performer to that of the first


def points(place, target_reach):
    """A performer's only joint, with a path of 60 from the pelvis in the source."""
    source = np.broadcast_to(place, (FRAMES, 1, 3))
    reaches = np.array([60.0]), np.array([target_reach])
    return ContactPoints(np.array([0]), np.array([0]), np.array(source), *reaches, np.zeros(FRAMES, np.intp))


def found(scale, *reaches):
    one, other = points(BETWEEN, reaches[0]), points(np.zeros(3), reaches[1])
    return find_performer_contacts(one, other, scale, UP, 0.02, ContactSettings())


@pytest.mark.parametrize("reaches", [(90.0, 90.0), (60.0, 120.0)])
def test_gaps_have_the_scale_of_the_world(reaches):
    """As the floor's along it, and as the bodies' upwards."""
    touching = found(RootScale(1.5, 1.2), *reaches)
    assert touching.frames.tolist() == list(range(FRAMES))
    np.testing.assert_allclose(touching.vectors, np.tile([3.0, 1.2, 3.0], (FRAMES, 1)))


@pytest.mark.parametrize("reaches", [(60.0, 60.0), (45.0, 75.0)])
def test_gaps_do_not_grow_with_legs_alone(reaches):
    """Both paths together are as long as in the source, so the gap is, although the world is half as large again."""
    np.testing.assert_allclose(found(RootScale.even(1.5), *reaches).vectors, np.tile(BETWEEN, (FRAMES, 1)))


def test_a_gap_is_off_by_what_its_length_is():
    contacts = found(RootScale.even(1.0), 60.0, 60.0)
    one = np.full((FRAMES, 1, 3), 4.0)
    for other, gap in ((one - 2.0 * BETWEEN, 6.0), (one + BETWEEN, 3.0)):
        gaps, wanted = contacts.gaps(one, other)
        np.testing.assert_allclose(gaps, gap)
        np.testing.assert_allclose(wanted, 3.0)


@pytest.mark.parametrize("cut_of", [0, 1])
def test_a_contact_right_after_a_cut_of_either_performer_does_not_set_in_before_it(cut_of):
    """Their clips are cut apart or together; either way what comes after a cut says nothing of what was before."""
    frames = 40
    shots = np.zeros((2, frames), np.intp)
    shots[cut_of, 20:] = 1
    places = np.where(np.arange(frames)[:, None] < 20, 10.0, 1.0) * BETWEEN
    both = [
        replace(points(BETWEEN, 60.0), source=source[:, None], shots=own)
        for source, own in zip((places, np.zeros((frames, 3))), shots, strict=True)
    ]
    contacts = find_performer_contacts(*both, RootScale.even(1.0), UP, 0.02, ContactSettings())
    assert contacts.frames.tolist() == list(range(20, frames))


@pytest.mark.parametrize("on", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("gives", [(1.0, 1.0), (30.0, 10.0)])
def test_both_go_to_where_they_meet_by_how_far_they_can(gives, on):
    """They meet as far apart as in the source; a contact that sets in moves them by its share from where they are."""
    near = found(RootScale.even(1.0), 60.0, 60.0)
    near = replace(near, f=np.full(len(near.frames), on))
    one, other = np.full((FRAMES, 1, 3), 7.0), np.full((FRAMES, 1, 3), -2.0)
    given = tuple(np.full((FRAMES, 1), give) for give in gives)
    units = 4.0, 2.0
    springs = near.springs((one, other), (one, other), given, units)
    places = [unit * each.rest for unit, each in zip(units, springs, strict=True)]
    np.testing.assert_allclose(places[0] - places[1], np.where(on, 9.0 + on * (near.vectors[:, None] - 9.0), 9.0))
    moved = [np.linalg.norm(place - at) for place, at in zip(places, (one, other), strict=True)]
    np.testing.assert_allclose(gives[1] * moved[0], gives[0] * moved[1], atol=1e-9)


def test_hands_that_are_merely_near_do_not_touch():
    """Two hands may be as far apart as two of one body, not twice as far because two bodies are between them."""
    for share, touches in ((0.9, True), (1.5, False)):
        away = share * ContactSettings().reach * 60.0 * np.array([1.0, 0.0, 0.0])
        both = points(away, 60.0), points(np.zeros(3), 60.0)
        contacts = find_performer_contacts(*both, RootScale.even(1.0), UP, 0.02, ContactSettings())
        assert bool(len(contacts.frames)) == touches
