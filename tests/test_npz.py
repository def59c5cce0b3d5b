"""Arrays of motions and labels of results in npz files: they come back, and equal ones make equal files."""

import time

import numpy as np
import pytest
from bodies import SAMPLES

from distretarget import METRICS, Motion, Skeleton, load_target, read_bvh, retarget, write_npz
from distretarget.io.motion_writer import npz
from distretarget.pipeline.result import labels_of


@pytest.fixture(scope="module")
def clap():
    return retarget(read_bvh(SAMPLES / "clap.bvh"), load_target(SAMPLES / "long_arms.json"))


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
    first = npz(labels_of(clap))
    monkeypatch.setattr(time, "time", lambda: 2e9)
    assert npz(labels_of(clap)) == first


def test_labels_say_when_hands_touch_and_feet_rest(clap):
    labels, frames = labels_of(clap), len(clap.motion)
    pair = labels["contact_names"].tolist().index("left hand - right hand")
    touches = np.isfinite(labels["contact_gaps"][:, pair])
    (hands,) = (touch for touch in clap.comparison.contacts.touches if touch.name == "left hand - right hand")
    assert np.flatnonzero(touches).tolist() == hands.frames.tolist()
    assert 0 < touches.sum() < frames
    assert np.nanmax(labels["contact_gaps"][:, pair]) < 0.2 * clap.matching.target.unit
    assert len(labels["support_names"]) == labels["support_weights"].shape[1] > 0
    assert labels["support_weights"].min() >= 0
    assert labels["support_weights"].max() <= 1
    assert not labels["shots"].any()
    assert not labels["not_converged"].any()
    assert labels["flags"].shape == (frames, len(labels["flag_names"]))


def test_frames_are_flagged_by_the_metrics_of_the_warnings(clap):
    labels, metrics = labels_of(clap), clap.metrics["result"]
    flagged = {name for name, flags in zip(labels["flag_names"], labels["flags"].T, strict=True) if flags.any()}
    assert flagged <= {one.key for one in METRICS if one.over_limit(clap.metrics)}
    assert metrics.keys() >= flagged


def test_a_cut_starts_another_shot():
    clip = read_bvh(SAMPLES / "clap.bvh")
    shifted = np.array(clip.root_positions)
    shifted[100:] += [500.0, 0.0, 0.0]
    cut = Motion(clip.skeleton, shifted, clip.rotations, clip.frame_time_text)
    shots = labels_of(retarget(cut, load_target(SAMPLES / "long_arms.json")))["shots"]
    assert np.flatnonzero(np.diff(shots)).tolist() == [99]
