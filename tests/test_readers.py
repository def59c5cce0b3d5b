"""Written files mean the same to other readers: bvhio and pybvh."""

import warnings

import numpy as np
import pytest
from bodies import of_samples_and_corpus
from edits import ARMS_AND_LEGS, edited

from distretarget import read_bvh, retarget, write_bvh
from distretarget.body.body import Body

clips = of_samples_and_corpus(
    "animated_drawings/dab",
    "animated_drawings/jesse_dance",
    "bvhio/example",
    "cmu_daz/05_03",
    "cmu_mb/12_01",
    "makehuman/walk1",
    "pybvh/bvh_test2",
    "synthetic_odd/odd_order_yxz",
)


def written(path, frames, folder):
    """A clip on another body: the file, and its first frames as this package reads them."""
    source = read_bvh(path)
    start = source[:frames]
    result = retarget(start, edited(source.rigid_skeleton, ARMS_AND_LEGS))
    write_bvh(folder / "out.bvh", result.motion)
    return folder / "out.bvh", read_bvh(folder / "out.bvh")


@clips
def test_bvhio(path, tmp_path):
    bvhio = pytest.importorskip("bvhio", reason="bvhio is not installed; it has no builds for Python 3.14")
    file, motion = written(path, 4, tmp_path)
    root = bvhio.readAsHierarchy(str(file))
    joints = np.flatnonzero(~motion.skeleton.end_sites)
    for frame in range(len(motion)):
        root.loadPose(frame)
        positions = {joint.Name: joint.PositionWorld.to_tuple() for joint, _, _ in root.layout()}
        expected = [positions[motion.skeleton.names[joint]] for joint in joints]
        atol = 1e-4 * Body.of(motion.skeleton).height
        np.testing.assert_allclose(motion.positions[frame, joints], expected, rtol=0, atol=atol)


@clips
def test_pybvh(path, tmp_path):
    import pybvh

    file, motion = written(path, 100, tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pybvh warns that it guesses the up axis
        expected = pybvh.read_bvh_file(file).node_positions()
    atol = 1e-6 * Body.of(motion.skeleton).height
    np.testing.assert_allclose(motion.positions, expected, rtol=0, atol=atol)
