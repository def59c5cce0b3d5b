"""Targets whose root cannot move along some axes: joints below carry the path, or the run says that it is lost."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import SAMPLES, person

from distretarget import load_target, read_bvh, retarget, write_bvh
from distretarget.baseline.engine_root import path_carriers
from distretarget.skeleton import POSITION_CHANNELS, Skeleton

PATH = POSITION_CHANNELS
TURN = ("Zrotation", "Xrotation", "Yrotation")


def below(channels, offset=(0.0, 0.0, 0.0), hips=(*PATH, *TURN)):
    """A person below a root with these channels; the hips are joint 1."""
    body = person()
    return Skeleton(
        names=("Armature", *body.names),
        parents=np.array([-1, *(body.parents + 1)]),
        offsets=np.vstack([offset, [0.0, 0.9, 0.0], body.offsets[1:]]),
        channels=(channels, hips, *body.channels[1:]),
        end_sites=np.array([False, *body.end_sites]),
    )


def squat():
    return read_bvh(SAMPLES / "squat.bvh")


def rewritten(motion, folder):
    """The positions of the joints after a round trip through a BVH file, which has them depth first."""
    write_bvh(folder / "out.bvh", motion)
    return read_bvh(folder / "out.bvh").positions[:, np.argsort(motion.skeleton.depth_first)]


@pytest.mark.parametrize("channels", [(), TURN, ("Yposition",), ("Xposition", "Zposition", *TURN)])
@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (0.3, 0.1, -0.2)])
def test_hips_carry_the_path_that_the_root_cannot(channels, offset, tmp_path):
    usual = retarget(squat(), below((*PATH, *TURN))).motion
    result = retarget(squat(), below(channels, offset))
    written = rewritten(result.motion, tmp_path)[:, 1:]
    np.testing.assert_allclose(written, result.motion.positions[:, 1:], atol=1e-6)
    across = written - usual.positions[:, 1:]
    np.testing.assert_allclose(across, np.broadcast_to(across[0, 0], across.shape), atol=1e-6)
    assert not result.warnings
    held = [axis for axis, channel in enumerate(PATH) if channel not in channels]
    np.testing.assert_allclose(result.motion.root_positions[:, held], np.broadcast_to(offset, (len(usual), 3))[:, held])


def test_a_target_that_cannot_travel_says_so_and_its_figures_are_those_of_the_file(tmp_path):
    result = retarget(squat(), below((), hips=TURN))
    assert result.warnings[0] == (
        "the body stays in place: the target's root 'Armature' and the joints below lack position channels"
    )
    written = rewritten(result.motion, tmp_path)
    np.testing.assert_allclose(written, result.motion.positions, atol=1e-6)
    assert np.ptp(written[:, 1], axis=0).max() == 0.0
    assert "feet skate more than in the source" in result.verdict
    assert "Check: foot skate, foot height" in result.verdict


def test_carriers_are_the_topmost_joints_that_hold_the_whole_body():
    body = np.arange(1, len(person()) + 1)
    assert path_carriers(below((*PATH, *TURN)), body) == []
    assert path_carriers(below(TURN), body) == [1]
    assert path_carriers(below(TURN, hips=TURN), body) is None
    deeper = below(TURN, hips=TURN)
    channels = list(deeper.channels)
    channels[2] = (*PATH, *TURN)
    chest = replace(deeper, channels=tuple(channels))
    assert path_carriers(chest, np.array(chest.subtree(2))) == [2]
    assert path_carriers(chest, body) is None


def test_other_targets_keep_their_motion():
    target = load_target(SAMPLES / "long_arms.json")
    assert retarget(squat(), target).motion.moving is None
