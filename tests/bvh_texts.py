"""A BVH file as text, edits of it, and the comparison of motions."""

import numpy as np

from distretarget.io.bvh_writer import bvh_parts

TEXT = """\
HIERARCHY
ROOT Hips
{
  OFFSET 1.0 2.0 3.0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Chest
  {
    OFFSET 0.0 5.25 0.1
    CHANNELS 3 Yrotation Xrotation Zrotation
    JOINT Head
    {
      OFFSET 0.0 4.0 0.0
      CHANNELS 2 Xrotation Yrotation
      End Site
      {
        OFFSET 0.0 1.0 0.5
      }
    }
  }
  JOINT Leg
  {
    OFFSET 0.5 -3.0 0.0
    CHANNELS 1 Xrotation
    End Site
    {
      OFFSET 0.0 -4.0 1.0
    }
  }
}
MOTION
Frames: 3
Frame Time: 0.0333333
0 10 0 0 0 0 0 0 0 0 0 0
0.5 10.25 1 10 20 30 -40 50.5 60 12 13 70
1 10.5 2 370 20 30 -400 50.5 60 12 13 885
"""
JOINTS = ("Hips", "Chest", "Head", "Head_End", "Leg", "Leg_End")
HIERARCHY, MOTION = TEXT[: TEXT.index("MOTION")], TEXT[TEXT.index("MOTION") :]


def edit(*changes):
    """The text with each (old, new) replaced once; it fails where `old` is not there."""
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def format_bvh(motion):
    """The BVH text of a motion."""
    return "".join(bvh_parts(motion))


def assert_same_joints(skeleton, other):
    assert skeleton.names == other.names
    assert skeleton.channels == other.channels
    np.testing.assert_array_equal(skeleton.parents, other.parents)
    np.testing.assert_array_equal(skeleton.end_sites, other.end_sites)


def assert_same(motion, other, atol=0.0):
    assert motion.frame_time_text == other.frame_time_text
    assert_same_joints(motion.skeleton, other.skeleton)
    assert motion.positions.shape == other.positions.shape
    assert np.all(np.isfinite(motion.positions))
    np.testing.assert_allclose(motion.positions, other.positions, rtol=0, atol=atol)
    agreement = np.abs(np.sum(motion.rotations * other.rotations, axis=-1))
    np.testing.assert_allclose(agreement, 1.0, atol=1e-12)
