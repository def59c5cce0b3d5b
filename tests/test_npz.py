"""Arrays of motions and labels of results in npz files: they come back, and equal ones make equal files."""

import time

import numpy as np
import pytest
from bodies import sample, sample_target

from distretarget import METRICS, Motion, Skeleton, retarget, write_motion, write_npz
from distretarget.errors import FileError
from distretarget.io.arrays import npz


@pytest.fixture(scope="module")
def clap():
    return retarget(sample("clap"), sample_target("long_arms"))


def loaded(path):
    with np.load(path, allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


def motion_of(arrays):
    """The motion in arrays whose rotations are quaternions."""
    parents = arrays["parents"]
    channels = [() if end else ("Zrotation", "Xrotation", "Yrotation") for end in arrays["end_sites"]]
    skeleton = Skeleton(
        names=tuple(arrays["names"].tolist()),
        parents=parents,
        offsets=arrays["offsets"],
        channels=tuple(channels),
        end_sites=arrays["end_sites"],
    )
    rotations = arrays["local_rotations"].astype(float)
    rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    return Motion(skeleton, arrays["root_path"], rotations, repr(float(arrays["frame_time"])))


@pytest.mark.parametrize(("precision", "tolerance"), [("float64", 1e-12), ("float32", 1e-6)])
def test_a_motion_comes_back_from_its_arrays(clap, tmp_path, precision, tolerance):
    write_npz(tmp_path / "clap.npz", clap.motion, precision=precision)
    arrays = loaded(tmp_path / "clap.npz")
    assert arrays["positions"].dtype == arrays["local_rotations"].dtype == precision
    assert arrays["frame_time"] == clap.motion.frame_time
    size = np.abs(clap.motion.positions).max()
    np.testing.assert_allclose(motion_of(arrays).positions, clap.motion.positions, atol=10 * tolerance * size)
    np.testing.assert_allclose(arrays["positions"], clap.motion.positions, atol=tolerance * size)


def test_equal_arrays_make_equal_files_at_any_time(clap, monkeypatch):
    first = npz(clap.labels)
    monkeypatch.setattr(time, "time", lambda: 2e9)
    assert npz(clap.labels) == first


def test_labels_say_when_hands_touch_and_feet_rest(clap):
    labels, frames = clap.labels, len(clap.motion)
    pair = labels["contact_names"].tolist().index("left hand - right hand")
    touches = np.isfinite(labels["contact_gaps"][:, pair])
    (hands,) = (touch for touch in clap.comparison.contacts.touches if touch.name == "left hand - right hand")
    assert np.flatnonzero(touches).tolist() == hands.frames.tolist()
    assert 0 < touches.sum() < frames
    assert np.nanmax(labels["contact_gaps"][:, pair]) < 0.2 * clap.matching.target.unit
    feet = [name in ("LeftAnkle", "LeftToe", "RightAnkle", "RightToe") for name in labels["support_names"]]
    assert sum(feet) == 4
    assert labels["support_weights"][:, feet].min() == 1  # it claps on its feet, and on nothing else
    assert not labels["support_weights"][:, np.logical_not(feet)].any()
    assert labels["support_weights"].min() >= 0
    assert labels["support_weights"].max() <= 1
    assert not labels["shots"].any()
    assert not labels["not_converged"].any()
    assert labels["flags"].shape == (frames, len(labels["flag_names"]))


def test_labels_of_all_clips_and_source_rigs_stack_on_one_target(clap, tmp_path):
    """Bodies that rest on hands or knees, and a source without hands."""
    target = sample_target("long_arms")
    crawl, kneel = (sample(f"supports/{name}") for name in ("crawl", "kneel"))
    no_hands = {key: None for key in clap.motion.skeleton.keys if "Wrist" in key}
    for number, (source, pairs) in enumerate([(crawl, {}), (kneel, {}), (clap.source, no_hands)]):
        write_npz(tmp_path / f"{number}.npz", retarget(source, target, joint_map=pairs))
    write_npz(tmp_path / "clap.npz", clap)
    clips = [loaded(path) for path in sorted(tmp_path.glob("*.npz"))]
    for name in clips[0]:
        if name.endswith("names"):
            assert (np.stack([clip[name] for clip in clips]) == clips[0][name]).all()
        elif np.ndim(clips[0][name]) and len(clips[0][name]) == len(crawl):
            assert len(np.stack([clip[name][:60] for clip in clips])) == len(clips)
    assert {clip["support_weights"].any(axis=0).sum() for clip in clips} != {4}


@pytest.mark.parametrize("write", [write_npz, write_motion])
def test_a_result_is_written_with_its_labels_and_a_motion_without(clap, tmp_path, write):
    write(tmp_path / "result.npz", clap)
    write(tmp_path / "motion.npz", clap.motion)
    result, motion = loaded(tmp_path / "result.npz"), loaded(tmp_path / "motion.npz")
    assert result.keys() - motion.keys() == clap.labels.keys()
    for name, values in clap.labels.items():
        np.testing.assert_array_equal(result[name], values)


def test_frames_are_flagged_by_the_metrics_of_the_warnings(clap):
    labels, metrics = clap.labels, clap.metrics["result"]
    flagged = {name for name, flags in zip(labels["flag_names"], labels["flags"].T, strict=True) if flags.any()}
    assert flagged <= {one.key for one in METRICS if one.over_limit(clap.metrics)}
    assert metrics.keys() >= flagged


def test_a_cut_starts_another_shot():
    clip = sample("clap")
    shifted = np.array(clip.root_positions)
    shifted[100:] += [500.0, 0.0, 0.0]
    cut = Motion(clip.skeleton, shifted, clip.rotations, clip.frame_time_text)
    shots = retarget(cut, sample_target("long_arms")).labels["shots"]
    assert np.flatnonzero(np.diff(shots)).tolist() == [99]


def test_arrays_as_a_target_are_no_character(clap, tmp_path):
    write_npz(tmp_path / "body.npz", clap.motion)
    with pytest.raises(FileError, match=r"'.*body.npz' is a file of arrays; write .bvh"):
        write_motion(tmp_path / "out.glb", clap.motion, tmp_path / "body.npz")
