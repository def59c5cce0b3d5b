"""Solving a clip in chunks: every frame once, no seam, the same result by every executor."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from bodies import SAMPLES

from distretarget import load_target, read_bvh, retarget
from distretarget.body.body import Body
from distretarget.ik.poses import CHUNK_FRAMES, LEAD_IN, chunks_of

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


@pytest.mark.parametrize("clip", ["clap", "hands_on_hips", "squat", "walk", "wave"])
def test_a_cut_leaves_no_seam(clip, monkeypatch):
    source = read_bvh(SAMPLES / f"{clip}.bvh")
    target = load_target(SAMPLES / "long_arms.json").for_source(source.skeleton).skeleton
    whole = retarget(source, target).motion.positions
    monkeypatch.setattr("distretarget.ik.poses.CHUNK_FRAMES", SHORT)
    assert len(chunks_of(len(source), 0)) > 1
    cut = retarget(source, target).motion.positions
    assert np.abs(cut - whole).max() < 1e-6 * Body.of(target).height


def test_fingers_on_the_floor_begin_a_chunk_where_the_chunk_before_leaves_them(monkeypatch):
    """Which way fingers that nothing drives give way to the floor depends on the frames before: chunks solve some."""
    source = read_bvh(SAMPLES / "supports" / "crawl.bvh")
    target = load_target(SAMPLES / "rigs" / "mixamo_t.json")
    whole = retarget(source, target)
    monkeypatch.setattr("distretarget.ik.poses.CHUNK_FRAMES", 40)
    cut = retarget(source, target).motion.positions
    assert np.abs(cut - whole.motion.positions).max() < 1e-5 * whole.matching.target.height


def test_whoever_solves_the_chunks_the_result_is_the_same(monkeypatch):
    monkeypatch.setattr("distretarget.ik.poses.CHUNK_FRAMES", SHORT)
    source = read_bvh(SAMPLES / "clap.bvh")
    target = load_target(SAMPLES / "long_arms.json").for_source(source.skeleton).skeleton
    done = []
    one = retarget(source, target, progress=done.append)
    with ThreadPoolExecutor(2) as pool:
        other = retarget(source, target, mapper=pool.map)
    np.testing.assert_array_equal(one.motion.rotations, other.motion.rotations)
    np.testing.assert_array_equal(one.effort.iterations, other.effort.iterations)
    assert len(done) > 1
    assert sum(done) == len(source)
