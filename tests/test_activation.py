"""Activation: when joints that come near each other are in contact, and when they are not."""

import numpy as np
import pytest
from bodies import person
from scipy.spatial.transform import Rotation

from distretarget import Body
from distretarget.body.limbs import Arm, before, raised
from distretarget.objectives.activation import FADE, ContactSettings, SelfContact, activation

REACH = ContactSettings().reach
SELF = SelfContact(lead=5.0, held=5, reach=REACH)
HANGING = 0.1  # D of a pair in a body with hanging arms


def one_shot(frames):
    return np.zeros(len(frames), np.intp)


def smootherstep(D):
    t = np.clip((REACH + FADE - D) / FADE, 0, 1)
    return 6 * t**5 - 15 * t**4 + 10 * t**3


@pytest.mark.parametrize("lead", [0, 1, 7])
def test_a_lasting_distance_has_a_full_activation_when_close_and_none_when_apart(lead):
    D = np.tile([0.0, REACH / 2, REACH, REACH + FADE / 2, REACH + FADE, 0.9], (40, 1))
    np.testing.assert_allclose(
        activation(D, one_shot(D), lead, REACH), np.tile([1, 1, 1, 0.5, 0, 0], (40, 1)), atol=1e-12
    )


@pytest.mark.parametrize("lead", [0, 1, 4, 18])
def test_an_activation_is_never_below_what_the_distance_asks_for_where_it_lasts_two_frames(lead):
    draw = np.random.default_rng(0)
    D = np.repeat(draw.uniform(0.05, 0.22, (100, 5)), 2, axis=0)
    assert np.all(activation(D, one_shot(D), lead, REACH) >= smootherstep(D) - 1e-12)


def test_an_activation_falls_as_the_distance_grows():
    D = np.tile(np.linspace(0, 0.3, 301), (5, 1))
    f = activation(D, one_shot(D), 0, REACH)[2]
    assert np.all(np.diff(f) <= 0)
    assert np.all((f >= 0) & (f <= 1))
    assert np.abs(np.diff(f, 2)).max() < 0.005


@pytest.mark.parametrize("lead", [6, 18])
def test_a_pair_that_comes_near_at_once_sets_in_smoothly_and_ahead(lead):
    D = np.where(np.abs(np.arange(200) - 100) <= 10, 0.05, 0.4)[:, None]
    f = activation(D, one_shot(D), lead, REACH)[:, 0]
    assert np.all(f[90:111] == pytest.approx(1.0))
    assert np.all(f[: 90 - 2 * lead] == 0)
    assert np.all(f[111 + 2 * lead :] == 0)
    assert np.all(np.diff(f)[:100] >= -1e-12)
    assert np.abs(np.diff(f)).max() < 1.5 / lead
    assert np.abs(np.diff(f, 2)).max() < 6 / lead**2
    np.testing.assert_allclose(f, f[::-1][np.arange(-1, 199)], atol=1e-12)


def test_a_contact_right_after_a_cut_does_not_set_in_before_it():
    D = np.where(np.arange(80) < 40, 0.4, 0.05)[:, None]
    shots = (np.arange(80) >= 40).astype(np.intp)
    np.testing.assert_allclose(activation(D, shots, 9, REACH)[:, 0], shots, atol=1e-12)
    assert activation(D, one_shot(D), 9, REACH)[30] > 0


def of_self(D, raised, hanging=HANGING):
    return SELF.activation(D[:, None], np.array([hanging]), raised[:, None], one_shot(D), np.ones((len(D), 1)))[:, 0]


def test_a_hand_that_hangs_is_in_no_contact_and_one_that_comes_clearly_nearer_is():
    hangs = np.zeros(60)
    assert not of_self(np.full(60, HANGING), hangs).any()
    assert not of_self(np.full(60, 0.95 * HANGING), hangs).any()
    np.testing.assert_allclose(of_self(np.full(60, 0.5 * HANGING), hangs), 1.0)
    f = [of_self(np.full(60, share * HANGING), hangs)[30] for share in np.linspace(0.5, 1.0, 21)]
    assert np.all(np.diff(f) <= 0)


def test_a_hand_that_stays_near_on_a_bent_arm_is_in_contact_and_one_that_passes_is_not():
    bent, stays = np.ones(120), np.full(120, HANGING)
    np.testing.assert_allclose(of_self(stays, bent), 1.0)
    np.testing.assert_allclose(of_self(stays, 0.5 * bent), 0.5)
    passes = HANGING + 0.01 * np.abs(np.arange(120) - 60)
    assert not of_self(passes, bent).any()


def test_without_a_known_pose_with_hanging_arms_near_is_a_contact():
    D = np.linspace(0.0, 0.3, 80)
    np.testing.assert_allclose(of_self(D, np.zeros(80), np.inf), activation(D[:, None], one_shot(D), 5.0, REACH)[:, 0])


@pytest.mark.parametrize("raised", [0.0, 1.0])
def test_pairs_beyond_their_limit_are_in_no_contact(raised):
    limit = SELF.apart(np.array([HANGING]), np.array([raised > 0]))[0]
    assert not of_self(np.full(50, limit), np.full(50, raised)).any()
    assert of_self(np.full(50, 0.9 * limit), np.full(50, raised)).any()


def test_an_activation_depends_on_its_window_only():
    draw = np.random.default_rng(0)
    D, up = draw.uniform(0.02, 0.2, 200), draw.uniform(0, 1, 200)
    whole, frame = of_self(D, up), 90
    D[: frame - SELF.window], up[frame + SELF.window + 1 :] = 0.0, 1.0
    assert of_self(D, up)[frame] == whole[frame]


def test_arms_hang_by_gravity_or_along_the_trunk_and_elbows_count():
    """An arm along X: shoulder, elbow, wrist, and the hip below the shoulder."""
    arm, up = Arm(0, 1, 2), np.array([0.0, 1.0, 0.0])
    straight = np.array([[0, 0, 0], [0, -1, 0], [0, -2, 0], [0, -2, 0]], float)

    def of(shoulder, elbow, whole=0.0):
        x = straight.copy()
        x[2] = x[1] + Rotation.from_euler("X", elbow, degrees=True).apply(x[2] - x[1])
        x[1:3] = Rotation.from_euler("X", shoulder, degrees=True).apply(x[1:3])
        return raised(Rotation.from_euler("X", whole, degrees=True).apply(x)[None], arm, [3], up)[0]

    assert of(20, 30) == 0.0
    assert of(50, 60) == pytest.approx(1.0)
    assert 0 < of(0, 80) < 1
    assert of(90, 0) > of(70, 0)
    assert of(0, 0, whole=90) == 0.0  # lies with its arms along the trunk
    assert of(-90, 0, whole=90) == 0.0  # bends forwards, and its arms hang


@pytest.mark.parametrize(
    ("angle", "expected"), [(0, 0.0), (30, 0.0), (45, 0.5), (60, 1.0), (90, 1.0), (150, 0.0), (-90, 1.0)]
)
def test_a_hanging_hand_is_put_in_front_of_the_trunk_or_behind_it(angle, expected):
    """Shoulders, hips and a hand at an angle from the left, round a trunk that is bent and turned."""
    hand = np.array([0.2 * np.cos(np.radians(angle)), -0.1, 0.2 * np.sin(np.radians(angle))])
    x = np.array([[0.2, 0.5, 0], [-0.2, 0.5, 0], [0.1, 0, 0], [-0.1, 0, 0], hand])
    x = Rotation.from_euler("XYZ", [40, 70, 20], degrees=True).apply(x) + 3.0
    assert before(x[None], [4], [0, 1], [2, 3])[0] == pytest.approx(expected, abs=1e-9)


def test_hanging_arms_are_as_long_as_the_arms_and_below_the_shoulders():
    body = Body.of(person())
    assert len(body.arms) == 2
    for arm in body.arms:
        hand = body.hanging[arm.wrist] - body.hanging[arm.shoulder]
        reach = body.skeleton.paths_from(arm.shoulder)[arm.wrist]
        np.testing.assert_allclose(hand, -reach * body.reference.axes[:, 1], atol=1e-9)
    others = np.setdiff1d(
        np.arange(len(body.skeleton)), [j for arm in body.arms for j in body.skeleton.subtree(arm.shoulder)]
    )
    np.testing.assert_array_equal(body.hanging[others], body.reference.positions[others])
