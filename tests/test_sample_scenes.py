"""The sample scenes: what touches by construction goes on touching on other bodies."""

from functools import cache

import numpy as np
import pytest
from bodies import SAMPLES, sample_target
from sample_scenes import SCENES

from distretarget import retarget_scene
from distretarget.scene.scene_file import load_scene

ARM = 53.1  # length of the sample body's arm [cm]
OFF = 0.01  # how far the gap of a contact may be off the source's, in the source's world [arms]
# ... and between a child and a body of the source's size, as docs/scenes.md has it
OFF_BETWEEN_SIZES = {"push": 0.0255, "waltz": 0.02, "lift": 0.032, "handshake": 0.052, "high_five": 0.065}

scenes = pytest.mark.parametrize("name", SCENES)


@cache
def made(name):
    return SCENES[name]()


@cache
def result(name):
    return load_scene(SAMPLES / "scenes" / name / "scene.json").retargeted()


def gaps(contact, sources, motions):
    """(frames,), how far what touches is apart."""
    frames = slice(contact.first, contact.last + 1)
    one, other = contact.one[0], contact.other[0]
    x = motions[one][frames, joint_of(contact.one, sources)]
    if other < len(sources):
        return np.linalg.norm(x - motions[other][frames, joint_of(contact.other, sources)], axis=1)
    return np.linalg.norm(x[:, None] - motions[other][frames], axis=2).min(axis=1)


def joint_of(place, sources):
    number, joint = place
    return sources[number].skeleton.index(joint)


def check_gaps(name, done, off):
    """Check that known contacts are no further off than this [arms]."""
    sources = [one.source for one in done.results]
    before = [motion.positions for motion in [*sources, *(prop.source for prop in done.props)]]
    after = [each.motion.positions for each in (*done.results, *done.props)]
    for contact in made(name).contacts:
        prop = contact.other[0] - len(sources)
        scale = done.props[prop].scale if prop >= 0 else done.world_scale
        source, now = gaps(contact, sources, before), gaps(contact, sources, after) / scale
        assert source.max() < 0.2 * ARM, contact
        assert np.abs(now - source).max() < off * ARM, contact


@scenes
def test_what_touches_in_the_sample_touches_on_a_child(name):
    check_gaps(name, result(name), OFF)


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("name", OFF_BETWEEN_SIZES)
def test_what_touches_between_a_child_and_an_adult_stays_near(name, order):
    sources = list(made(name).performers.values())
    body = sources[0].rigid_skeleton
    child = sample_target("child").for_source(body).skeleton
    check_gaps(name, retarget_scene(sources, [child, body][::order]), OFF_BETWEEN_SIZES[name])


@scenes
def test_performers_are_solved_and_their_feet_stand(name):
    for one in result(name).results:
        metrics = one.metrics["result"]
        assert metrics["not_converged"] == 0
        assert metrics["turn"] < 15
        assert (metrics["foot_height"] or 0.0) < 0.5


def test_a_staff_keeps_its_shape_in_both_hands():
    (staff,) = result("staff").props
    assert staff.scale == pytest.approx(0.6)
    lengths = np.linalg.norm(staff.motion.positions[:, 1] - staff.motion.positions[:, -1], axis=1)
    np.testing.assert_allclose(lengths, 0.6 * 160)
