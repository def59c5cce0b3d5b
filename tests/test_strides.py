"""Strides that legs can follow."""

import numpy as np
from bodies import SAMPLES, matched, person, swaying

from distretarget import read_bvh
from distretarget.baseline.rotation_copy import SINK, longest_strides


def test_who_walks_can_take_somewhat_longer_strides():
    motion = read_bvh(SAMPLES / "walk.bvh")
    assert 1.2 < longest_strides(matched(motion, motion)) < 2.0


def test_who_stands_can_step_far():
    motion = read_bvh(SAMPLES / "wave.bvh")
    assert longest_strides(matched(motion, motion)) > 4.0


def test_where_no_foot_rests_anything_goes():
    body = swaying(person(), frames=8)
    assert longest_strides(matched(body, body)) == np.inf


def test_hips_may_sink_only_a_little():
    assert 0 < SINK < 0.2
