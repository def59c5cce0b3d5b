"""Heels: how far those of long feet lift while they rest."""

import numpy as np
import pytest
from bodies import UP, lengthened, matched, person, posed
from scipy.spatial.transform import Rotation

from distretarget import Options, Skeleton, retarget
from distretarget.baseline.rotation_copy import RootScale
from distretarget.objectives.clip import Clip
from distretarget.objectives.heels import with_low_heels

LEG, FOOT, TOES = 0.435 + 0.453, 0.125, 0.06
ROLL = 0.05 * LEG


def on_toes(angle, path=None):
    """A person whose left foot points down by an angle [rad]."""
    path = np.zeros((40, 3)) if path is None else path
    return posed(person(), {"LeftAnkle": np.array([angle, 0.0, 0.0])}, path + (LEG + 0.1) * UP)


def lift(motion):
    """How much higher than the toe the left ankle is."""
    ankle, toe = (motion.positions[:, motion.skeleton.index(f"Left{name}")] for name in ("Ankle", "Toe"))
    return (ankle - toe) @ UP


def clip_of(source, factor):
    return Clip.of(matched(source, lengthened(person(), {"Toe": factor})), RootScale.even(1.0))


def test_the_heel_of_a_foot_twice_as_long_lifts_less():
    angle = 0.5
    share = 1.0 - ((FOOT + TOES) * np.sin(angle) + ROLL) / ((2 * FOOT + TOES) * np.sin(angle) + ROLL)
    expected = 2 * FOOT * np.sin(angle * (1.0 - share))
    clip = clip_of(on_toes(angle), 2.0)
    np.testing.assert_allclose(lift(clip.copy), 2 * FOOT * np.sin(angle))
    np.testing.assert_allclose(lift(with_low_heels(clip).copy), expected)
    others = [joint for joint, name in enumerate(clip.skeleton.names) if not name.startswith("LeftToe")]
    np.testing.assert_allclose(
        with_low_heels(clip).copy.positions[:, others], clip.copy.positions[:, others], atol=1e-9
    )


@pytest.mark.parametrize("edge", [0.0, 0.3])
def test_a_long_foot_turns_back_from_steep_toes_rolled_or_not(edge):
    """A bone that points down shows hardly any way back, but the side of the foot does."""
    steep = Rotation.from_rotvec([0.0, 0.0, edge]) * Rotation.from_rotvec([1.05, 0.0, 0.0])
    clip = clip_of(posed(person(), {"LeftAnkle": steep.as_rotvec()}, np.tile((LEG + 0.1) * UP, (40, 1))), 2.0)
    assert np.all(lift(with_low_heels(clip).copy) < 0.78 * lift(clip.copy))


def test_a_foot_that_leaves_the_floor_turns_hardly_faster_for_it():
    """A foot that swings up behind the body after it stood on its toes."""
    frames = np.arange(80)
    angles = np.outer(0.6 + 1.6 * np.clip((frames - 40) / 8, 0, 1), [1.0, 0.0, 0.0])
    path = np.outer(np.clip(frames - 40, 0, None) * 0.03, UP)
    clip = clip_of(posed(person(), {"LeftAnkle": angles}, path + (LEG + 0.1) * UP), 2.0)
    ankle = clip.skeleton.index("LeftAnkle")
    turns = [
        (Rotation.from_quat(copy[1:]) * Rotation.from_quat(copy[:-1]).inv()).magnitude().max()
        for copy in (each.copy.world_rotations_of(ankle) for each in (clip, with_low_heels(clip)))
    ]
    assert turns[1] < 1.2 * turns[0]


@pytest.mark.parametrize(("factor", "angle"), [(1.0, 0.5), (0.6, 0.5), (2.0, 0.0), (2.0, -0.3)])
def test_feet_that_are_no_longer_and_feet_that_lift_no_heel_stay(factor, angle):
    clip = clip_of(on_toes(angle), factor)
    np.testing.assert_allclose(with_low_heels(clip).copy.positions, clip.copy.positions, atol=1e-9)


def test_a_foot_that_does_not_rest_stays():
    clip = clip_of(on_toes(0.5, np.outer(0.05 * np.arange(40), [0.0, 0.0, 1.0])), 2.0)
    assert with_low_heels(clip) is clip


def test_hips_over_one_foot_on_its_toes_and_a_flat_one_are_nearer_to_the_sources_height():
    metrics = retarget(on_toes(0.5), lengthened(person(), {"Toe": 2.0})).metrics["result"]
    assert metrics["hips_height_largest"] < 1.5  # 4.6 if the long foot points down as far as the source's


def ending_at_the_ball():
    """A person whose feet have an End Site in place of toes."""
    body = person()
    keep = np.array([joint for joint, name in enumerate(body.names) if not name.endswith("Toe_End")])
    names = [body.names[joint] for joint in keep]
    toes = np.array([name.endswith("Toe") for name in names])
    channels = tuple(() if toe else body.channels[joint] for joint, toe in zip(keep, toes, strict=True))
    return Skeleton(
        names=tuple(names),
        parents=body.parents[keep],
        offsets=body.offsets[keep],
        channels=channels,
        end_sites=body.end_sites[keep] | toes,
    )


@pytest.mark.parametrize(("pitch", "bent"), [(0.6, 0.6), (0.0, 0.0), (-0.4, 0.0)])
def test_toes_that_the_source_does_not_have_bend_where_the_foot_stands_on_them(pitch, bent):
    """Those of a foot on its heel do not."""
    path = np.tile((LEG + 0.1) * UP, (40, 1))
    source = posed(ending_at_the_ball(), {"LeftAnkle": np.array([pitch, 0.0, 0.0])}, path)
    result = retarget(source, person())
    for motion, expected in ((result.rotation_copy, 0.0), (result.motion, bent)):
        toe = Rotation.from_quat(motion.rotations[:, motion.skeleton.index("LeftToe")])
        np.testing.assert_allclose(toe.magnitude(), expected, atol=0.02)


def test_feet_that_are_free_keep_the_sources_rotation():
    result = retarget(on_toes(0.5), lengthened(person(), {"Toe": 2.0}), Options(supports="free"))
    np.testing.assert_allclose(lift(result.motion), lift(result.rotation_copy), atol=1e-6)
