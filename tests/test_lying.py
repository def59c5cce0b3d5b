"""Bodies that lie or sit on the floor with no foot on its sole: the floor is below their skin."""

import numpy as np
import pytest
from bodies import HERO, PERSON, UP, posed
from scipy.spatial.transform import Rotation

from distretarget import Body, load_target, retarget
from distretarget.body.soles import find_soles, points_down

FRAMES = 30
SUPINE, PRONE = (np.radians(turn) * np.array([1.0, 0.0, 0.0]) for turn in (-90, 90))
ON_SIDE = (Rotation.from_rotvec(SUPINE) * Rotation.from_rotvec(0.5 * np.pi * UP)).as_rotvec()


def lying(skeleton, turn, height):
    """A body that lies still, with its root at a height."""
    root = skeleton.names[0]
    return posed(skeleton, {root: np.tile(turn, (FRAMES, 1))}, np.zeros((FRAMES, 3)) + height * UP)


def lowest(mesh, motion):
    """(frames,), the height of the lowest vertex."""
    return mesh.heights(motion, UP).min(axis=1)


@pytest.mark.parametrize("turn", [SUPINE, PRONE, ON_SIDE], ids=["supine", "prone", "side"])
def test_on_its_own_rig_a_lying_body_stays_on_the_floor(turn):
    hero = load_target(HERO)
    mesh, source = hero.mesh(), lying(hero.skeleton, turn, 0.0)
    source = source.moved(-lowest(mesh, source)[0] * UP)
    np.testing.assert_allclose(lowest(mesh, retarget(source, hero).motion), 0.0, atol=0.01)


@pytest.mark.parametrize("height", [0.05, 0.12, 0.19])
@pytest.mark.parametrize("turn", [SUPINE, PRONE], ids=["supine", "prone"])
def test_a_lying_body_is_on_the_floor_also_if_its_file_is_a_little_off(turn, height):
    hero = load_target(HERO)
    result = retarget(lying(PERSON, turn, height), hero)
    np.testing.assert_allclose(lowest(hero.mesh(), result.motion), 0.0, atol=0.02)


@pytest.mark.parametrize("turn", [SUPINE, PRONE, ON_SIDE], ids=["supine", "prone", "side"])
def test_feet_of_a_lying_body_do_not_show_how_they_stand(turn):
    hero = load_target(HERO)
    soles = [retarget(lying(PERSON, each, 0.12), hero).matching.soles for each in (turn, np.zeros(3))]
    for foot, standing in zip(*soles, strict=True):
        np.testing.assert_allclose(foot[0].normal, standing[0].normal, atol=1e-6)


@pytest.mark.parametrize(
    ("turn", "down"),
    [
        (("X", 0), True),
        (("X", -30), True),
        (("X", 80), True),
        (("Z", 30), True),
        (("X", -80), False),
        (("X", 170), False),
        (("Z", 80), False),
    ],
)
def test_a_foot_points_down_with_its_sole_or_toes(turn, down):
    """From the standing foot: toes up, on its toes, tilted; on its heel, on its back, on its side."""
    body = Body.of(PERSON)
    motion = lying(PERSON, Rotation.from_euler(*turn, degrees=True).as_rotvec(), 1.0)
    for sole in find_soles(body, body.legs):
        assert (points_down(motion, sole, UP) == down).all()
