"""Feet that swing: how far they stay over the floor."""

import numpy as np
import pytest
from bodies import LEG, UP, body_of, lengthened, matched, mirrored, person, posed
from characters import Bones, character
from scipy.spatial.transform import Rotation

from distretarget import Skeleton, load_target, retarget
from distretarget.baseline.rotation_copy import RootScale
from distretarget.body.soles import sole_height
from distretarget.objectives.clip import Clip
from distretarget.objectives.foot_lock import find_foot_lock
from distretarget.objectives.leg_bends import CLEARANCE, SCUFF, with_swinging_feet_up

FRAMES = 100
TIME = np.clip((np.arange(FRAMES) - 20) / 60, 0, 1)
SWING = np.sin(np.pi * TIME) ** 2  # of the right foot, 0 to 1
PATH = np.outer(2 * LEG * (3 - 2 * TIME) * TIME**2, [0.0, 0.0, 1.0])  # the body goes on while it swings


def swinging(bend: float, pitch: float = 0.5, knee: float = 0.0):
    """A person who stands, makes a step with the right leg, with the knee bent by up to an angle and the foot pointing
    down by another, and stands; the knee of the standing person is bent backwards by a third [rad].
    """
    x = np.array([1.0, 0.0, 0.0])
    turns = {
        "RightHip": np.outer(-0.5 * bend * SWING, x),
        "RightKnee": np.outer(bend * SWING - knee, x),
        "RightAnkle": np.outer((pitch - 0.5 * bend) * SWING + knee, x),
    }
    return posed(person(), turns, PATH + (LEG + 0.1) * UP)


def clips(source, target):
    """The clip of a motion on a skeleton as copied, and with its feet up."""
    clip = Clip.of(matched(source, target), RootScale.even(1.0))
    return clip, with_swinging_feet_up(clip, find_foot_lock(clip), body_of(target).limbs, None)


def soles(clip):
    """(frames, 2), how high the soles are over where they stand [leg lengths]."""
    heights = [sole_height(clip.copy, pair.target_sole, UP) for pair in clip.legs]
    return np.transpose([each - each[0] for each in heights]) / LEG


def long_feet(times: float = 2.0) -> Skeleton:
    return lengthened(person(), {"Toe": times})


def test_long_toes_of_a_swinging_foot_pass_over_the_floor():
    copied, clip = clips(swinging(1.0), long_feet())
    of_source = soles(clips(swinging(1.0), person())[0])
    assert (soles(copied) - of_source).min() < -0.06
    assert (soles(clip) - of_source)[30:70].min() > -SCUFF - 1e-3
    lifted = (clip.copy.positions - copied.copy.positions)[:, clip.skeleton.index("RightAnkle")] @ UP
    assert lifted.min() >= 0.0
    assert lifted[SWING == 0].max() < 0.1 * lifted.max()


def test_the_skin_of_long_feet_passes_as_high_as_that_of_usual_ones(tmp_path):
    def heights(target):
        """(2, frames), how far the lowest skin of the right foot rises in result and copy [leg lengths]."""
        path = character(Bones.of(target, "m")).write(tmp_path / "target.glb")
        result = retarget(swinging(1.0), load_target(path))
        skeleton, each = result.motion.skeleton, (result.motion, result.rotation_copy)
        on = np.isin(result.mesh.carriers, skeleton.subtree(skeleton.index("RightAnkle")))
        lowest = np.array([result.mesh.heights(motion, UP)[:, on].min(axis=1) for motion in each])
        return (lowest - lowest[:, :1]) / LEG

    off = heights(long_feet()) - heights(person())
    assert off[1].min() < -0.06
    assert off[0].min() > -0.02


def test_only_the_leg_of_a_foot_that_is_lifted_moves_and_its_foot_keeps_its_rotation():
    copied, clip = clips(swinging(1.0), long_feet())
    leg = clip.skeleton.subtree(clip.skeleton.index("RightKnee"))
    others = np.setdiff1d(np.arange(len(clip.skeleton)), leg)
    np.testing.assert_allclose(clip.copy.positions[:, others], copied.copy.positions[:, others], atol=1e-12)
    np.testing.assert_allclose(clip.copy.positions[:, leg] @ [1, 0, 0], copied.copy.positions[:, leg] @ [1, 0, 0])
    foot = clip.skeleton.index("RightAnkle")
    turn = Rotation.from_quat(clip.copy.world_rotations[:, foot]).inv() * Rotation.from_quat(
        copied.copy.world_rotations[:, foot]
    )
    assert turn.magnitude().max() < 1e-7


@pytest.mark.parametrize(("source", "target"), [(swinging(1.0), person()), (swinging(2.0, 0.0), long_feet())])
def test_feet_that_are_over_the_floor_stay(source, target):
    copied, clip = clips(source, target)
    assert clip is copied


def test_a_foot_that_swings_high_is_lifted_just_over_the_floor():
    source, middle = swinging(1.5), np.argmax(SWING)
    assert soles(clips(source, person())[0])[middle, 1] > 0.15
    copied, clip = clips(source, long_feet(4.0))
    assert soles(copied)[middle, 1] < 0.0
    assert CLEARANCE - SCUFF < soles(clip)[middle, 1] < 2 * CLEARANCE


def test_mirrored_legs_are_lifted_alike():
    _, one = clips(swinging(1.0), long_feet())
    _, other = clips(mirrored(swinging(1.0)), long_feet())
    np.testing.assert_allclose(soles(one), soles(other)[:, ::-1], atol=1e-9)


def test_a_knee_that_bends_backwards_comes_forwards_without_a_jump():
    copied, clip = clips(swinging(0.5, 0.7, knee=0.05), long_feet())
    knee, ankle = (clip.skeleton.index(f"Right{name}") for name in ("Knee", "Ankle"))
    forward = (clip.copy.positions - copied.copy.positions)[:, knee, 2] / LEG
    assert forward.max() > 0.1
    assert np.abs(np.diff(forward, 2)).max() < 0.01
    assert (clip.copy.positions - copied.copy.positions)[:, ankle, 1].max() > 0.08 * LEG
