"""Calls side by side in threads."""

import threading

import numpy as np
import pytest

from distretarget.numerics import parallel as threads
from distretarget.numerics.parallel import FEWEST_JOINTS, cores, in_threads, mapper_for, over_blocks


@pytest.fixture(params=[1, 4], autouse=True)
def _any_cores(request, monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setattr(threads, "cores", lambda: request.param)


def test_results_are_those_of_map_in_order():
    assert list(in_threads(pow, range(20), range(1, 21))) == list(map(pow, range(20), range(1, 21)))


def test_calls_run_side_by_side(monkeypatch):
    """Each waits for the other, so that neither could end alone."""
    monkeypatch.setattr(threads, "cores", lambda: 2)
    meeting = threading.Barrier(2, timeout=60)
    assert sorted(in_threads(lambda _: meeting.wait(), range(2))) == [0, 1]


def test_an_error_of_a_call_reaches_the_caller():
    with pytest.raises(ZeroDivisionError):
        list(in_threads(lambda x: 1 // x, [1, 0, 2]))


def test_without_calls_there_are_no_results():
    assert list(in_threads(pow, [], [])) == []


def test_there_is_a_core():
    assert cores() >= 1


@pytest.mark.parametrize(("limit", "most"), [("1", 1), ("3", 3), ("9", 4), ("0", 1), ("", 4), ("x", 4), ("-2", 4)])
def test_there_are_no_more_threads_than_the_environment_says(limit, most, monkeypatch):
    monkeypatch.setattr(threads, "cores", lambda: 4)
    monkeypatch.setenv("OMP_NUM_THREADS", limit)
    assert threads.threads() == most


@pytest.mark.parametrize("frames", [0, 1, 385, 20_000])
@pytest.mark.parametrize("joints", [1, 40])
def test_each_frame_is_in_one_block(frames, joints):
    computed = np.zeros(frames, int)

    def compute(block):
        computed[block] += 1

    over_blocks(compute, frames, joints)
    assert (computed == 1).all()


def test_blocks_of_a_long_clip_are_computed_side_by_side(monkeypatch):
    monkeypatch.setattr(threads, "cores", lambda: 2)
    meeting = threading.Barrier(2, timeout=60)
    over_blocks(lambda _block: meeting.wait(), 768, FEWEST_JOINTS)
    assert mapper_for(768, FEWEST_JOINTS) is in_threads
    assert mapper_for(768, 1) is map


@pytest.mark.parametrize("first", [0, 384])
def test_an_error_in_a_block_reaches_the_caller(first):
    with pytest.raises(ZeroDivisionError):
        over_blocks(lambda block: 1 // (block.start - first), 768, FEWEST_JOINTS)
