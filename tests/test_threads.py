"""Work side by side: in threads, and a clip solved in chunks, by any executor, without a seam."""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from bodies import sample, sample_target

from distretarget import retarget
from distretarget.body.body import Body
from distretarget.ik.poses import CHUNK_FRAMES, LEAD_IN, chunks_of
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
    assert list(in_threads(pow, [], [])) == []
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


SHORT = 90  # frames per chunk, small because the clips of the tests are short


@pytest.mark.parametrize(
    "frames", [1, 2, CHUNK_FRAMES, CHUNK_FRAMES + CHUNK_FRAMES // 2 + 1, 5 * CHUNK_FRAMES + 3, 100_000]
)
@pytest.mark.parametrize("margin", [0, 7, 200])
def test_chunks_keep_every_frame_once(frames, margin):
    kept = []
    for chunk in chunks_of(frames, margin):
        context = np.arange(frames)[chunk.context]
        solved = context[chunk.solve]
        kept += solved[chunk.keep].tolist()
        assert solved[0] - context[0] == margin or context[0] == 0
        assert context[-1] - solved[-1] == margin or context[-1] == frames - 1
        assert chunk.keep.start == LEAD_IN or solved[0] == 0
    assert kept == list(range(frames))


def test_chunks_are_about_equal():
    sizes = [chunk.keep.stop - chunk.keep.start for chunk in chunks_of(10_000, 5)]
    assert max(sizes) - min(sizes) <= 1
    assert CHUNK_FRAMES / 1.5 < max(sizes) < CHUNK_FRAMES * 1.5


@pytest.mark.parametrize("clip", ["clap", "squat", "walk"])
def test_a_cut_leaves_no_seam(clip, monkeypatch):
    source = sample(clip)
    target = sample_target("long_arms").for_source(source.skeleton).skeleton
    whole = retarget(source, target).motion.positions
    monkeypatch.setattr("distretarget.ik.poses.CHUNK_FRAMES", SHORT)
    assert len(chunks_of(len(source), 0)) > 1
    cut = retarget(source, target).motion.positions
    assert np.abs(cut - whole).max() < 1e-6 * Body.of(target).height


def test_fingers_on_the_floor_begin_a_chunk_where_the_chunk_before_leaves_them(monkeypatch):
    """Which way fingers that nothing drives give way to the floor depends on the frames before: chunks solve some."""
    source = sample("supports/crawl")
    target = sample_target("rigs/mixamo_t")
    whole = retarget(source, target)
    monkeypatch.setattr("distretarget.ik.poses.CHUNK_FRAMES", 40)
    cut = retarget(source, target).motion.positions
    assert np.abs(cut - whole.motion.positions).max() < 1e-5 * whole.matching.target.height


def test_whoever_solves_the_chunks_the_result_is_the_same(monkeypatch):
    monkeypatch.setattr("distretarget.ik.poses.CHUNK_FRAMES", SHORT)
    source = sample("clap")
    target = sample_target("long_arms").for_source(source.skeleton).skeleton
    done = []
    one = retarget(source, target, progress=done.append)
    with ThreadPoolExecutor(2) as pool:
        other = retarget(source, target, mapper=pool.map)
    np.testing.assert_array_equal(one.motion.rotations, other.motion.rotations)
    np.testing.assert_array_equal(one.effort.iterations, other.effort.iterations)
    assert len(done) > 1
    assert sum(done) == len(source)
