"""Whole clips, from file to file: the samples, real files if the corpus is there, and the command that fetches some."""

from pathlib import Path

import fetch_corpus
import numpy as np
import pytest
from bodies import CORPUS, SAMPLES, needs_corpus
from click.testing import CliRunner
from clips import ARMS_AND_LEGS, CLIPS, edited

from distretarget import DistretargetError, Motion, Options, read_bvh, retarget, write_bvh
from distretarget.body.body import Body

REFUSED = {
    "odd_declared_less.bvh": "20 whole frames of 51 numbers",
    "odd_declared_more.bvh": "20 whole frames of 51 numbers",
    "odd_frame_time_zero.bvh": "a number above 0",
    "odd_frames_0.bvh": "no frames",
    "odd_last_row_short.bvh": "19 whole frames of 51 numbers and 46 numbers over",
    "odd_nan_value.bvh": "'nan'",
    "odd_two_roots.bvh": "second ROOT",
}
FRAMES = 200  # of each file
SAMPLE_FILES = sorted(SAMPLES.glob("*.bvh"))
CORPUS_FILES = sorted(CORPUS.rglob("*.bvh")) if CORPUS.is_dir() else []


def files(paths):
    return pytest.mark.parametrize("path", paths, ids=lambda path: f"{path.parent.name}/{path.name}")


clips = files([*SAMPLE_FILES, *(path for path in CORPUS_FILES if path.name not in REFUSED)])


def read_rigid(path):
    """The motion of a file, on bones that do not stretch."""
    motion = read_bvh(path)[:FRAMES]
    rigid = Motion(motion.rigid_skeleton, motion.root_positions, motion.rotations, motion.frame_time_text)
    stretch = np.abs(rigid.positions - motion.positions).max() / Body.of(motion.rigid_skeleton).height
    if stretch > 1e-9:
        pytest.skip(f"the bones stretch: joints are up to {stretch:.1e} heights off those of a rigid body")
    return rigid


def through_a_file(motion: Motion, folder: Path) -> Motion:
    write_bvh(folder / "out.bvh", motion)
    return read_bvh(folder / "out.bvh")


def assert_near(positions, expected, skeleton):
    """Assert that positions are equal to 1e-5 of the body's height."""
    np.testing.assert_allclose(positions, expected, rtol=0, atol=1e-5 * Body.of(skeleton).height)


@pytest.mark.parametrize("scale", [1.0, 0.37])
@clips
def test_a_scaled_body_gives_scaled_positions(path, scale, tmp_path):
    source = read_rigid(path)
    target = source.skeleton.with_offsets(scale * source.skeleton.offsets)
    written = through_a_file(retarget(source, target, Options(root_offset="replaced")).motion, tmp_path)
    assert written.frame_time_text == source.frame_time_text
    assert_near(written.positions, scale * source.positions, target)


@clips
def test_written_bones_are_the_targets(path, tmp_path):
    source = read_bvh(path)[:FRAMES]
    target = edited(source.rigid_skeleton, ARMS_AND_LEGS)
    written = through_a_file(retarget(source, target).motion, tmp_path)
    bones = written.positions[:, 1:] - written.positions[:, written.skeleton.parents[1:]]
    lengths = dict(zip(target.keys, target.lengths, strict=True))
    expected = np.array([lengths[key] for key in written.skeleton.keys[1:]])
    expected = np.broadcast_to(expected, bones.shape[:2])
    np.testing.assert_allclose(np.linalg.norm(bones, axis=-1), expected, rtol=1e-6)


@files([path for path in CORPUS_FILES if path.name in REFUSED])
def test_files_that_cannot_be_used_are_refused_with_a_reason(path):
    with pytest.raises(DistretargetError) as caught:
        retarget(motion := read_bvh(path), motion.rigid_skeleton)
    assert REFUSED[path.name] in str(caught.value)
    assert "\n" not in str(caught.value)


@needs_corpus
def test_the_corpus_is_whole():
    assert len(CORPUS_FILES) == 96
    assert {path.name for path in CORPUS_FILES} > set(REFUSED)


@pytest.fixture
def published(tmp_path):
    """A folder that is served like the repositories, without the last file; and the names of all."""
    names = []
    for name, address in fetch_corpus.addresses(str(tmp_path / "host")):
        Path(address).parent.mkdir(parents=True, exist_ok=True)
        Path(address).write_text(name, "utf-8")
        names.append(name)
    Path(address).unlink()
    return (tmp_path / "host").as_uri(), names


def test_every_clip_of_the_tables_is_published():
    assert {clip for clip in CLIPS if "/" in clip} <= {name for name, _ in fetch_corpus.addresses()}


def test_all_that_is_there_is_fetched_once_and_what_is_not_is_named(tmp_path, published):
    host, names = published
    folder = tmp_path / "corpus"
    done = CliRunner().invoke(fetch_corpus.main, [str(folder), "--host", host])
    assert done.exit_code == 1
    assert names[-1].rpartition("/")[2].removesuffix(".bvh") in done.output
    assert "1 files could not be fetched" in done.output
    assert [(folder / name).read_text("utf-8") for name in names[:-1]] == names[:-1]
    assert not (folder / names[-1]).exists()
    (folder / names[0]).write_text("own", "utf-8")
    again = CliRunner().invoke(fetch_corpus.main, [str(folder), "--host", host])
    assert "0 files fetched" in again.output
    assert (folder / names[0]).read_text("utf-8") == "own"
