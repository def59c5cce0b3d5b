"""The bridge to bvhio: the same motion in both directions, and errors where one side cannot hold it; and written
files as bvhio and pybvh read them.
"""

import sys
from dataclasses import replace

import numpy as np
import pytest
from bodies import of_samples_and_corpus, sample, swaying, tree_of
from bvh_texts import assert_same_joints
from scipy.spatial.transform import Rotation

from distretarget import Motion, read_bvh
from distretarget.body.body import Body
from distretarget.errors import MissingPackageError, MotionError, SkeletonError
from distretarget.io.interop import from_bvhio, to_bvhio

FLOAT32 = 1e-5  # of a body's height
clips = of_samples_and_corpus(
    "animated_drawings/dab",
    "bvhio/example",
    "makehuman/tpose",
    "pybvh/rotation_first_root",
    "synthetic_odd/odd_end_site_zero",
    "synthetic_odd/odd_frames_0",
    "synthetic_odd/odd_joint_without_channels",
    "synthetic_odd/odd_pos_on_every_joint",
)


@pytest.fixture
def bvhio():
    return pytest.importorskip("bvhio", reason="bvhio is not installed; it has no builds for Python 3.14")


def first_frames(path, frames=20):
    return read_bvh(path)[:frames]


def dance():
    """All joints of a sample's body in motion."""
    return swaying(sample("walk").skeleton)


def assert_same_body(motion, other):
    assert_same_joints(motion.skeleton, other.skeleton)
    np.testing.assert_allclose(motion.skeleton.offsets, other.skeleton.offsets, rtol=1e-6, atol=1e-30)


def assert_same(motion, other, atol=FLOAT32):
    assert_same_body(motion, other)
    assert motion.frame_time == other.frame_time
    assert motion.positions.shape == other.positions.shape
    size = atol * max(Body.of(motion.skeleton).height, np.abs(motion.root_positions).max(initial=0))
    np.testing.assert_allclose(motion.positions, other.positions, rtol=0, atol=size)
    np.testing.assert_allclose(np.abs(np.sum(motion.rotations * other.rotations, axis=-1)), 1, atol=1e-6)


@clips
def test_a_file_read_by_bvhio_is_the_same_motion(path, bvhio):
    motion = from_bvhio(bvhio.readAsBvh(str(path)))
    assert_same(motion, read_bvh(path))
    np.testing.assert_allclose(np.linalg.norm(motion.rotations, axis=-1), 1, rtol=0, atol=1e-12)


@clips
def test_bvhio_finds_the_joints_in_the_same_places(path, bvhio):
    motion = first_frames(path, frames=4)
    root = bvhio.convertBvhToHierarchy(to_bvhio(motion).Root).loadRestPose(recursive=True)
    joints = np.flatnonzero(~motion.skeleton.end_sites)
    for frame in range(len(motion)):
        root.loadPose(frame)
        expected = [joint.PositionWorld.to_tuple() for joint, _, _ in root.layout()]
        atol = FLOAT32 * Body.of(motion.skeleton).height
        np.testing.assert_allclose(motion.positions[frame, joints], expected, rtol=0, atol=atol)


@clips
def test_a_file_written_by_bvhio_reads_back(path, bvhio, tmp_path):
    motion = first_frames(path)
    bvhio.writeBvh(str(tmp_path / "out.bvh"), to_bvhio(motion))
    assert_same(read_bvh(tmp_path / "out.bvh"), motion)


def with_orders(motion, orders):
    """The motion on a body whose joints take turns at these rotation orders, every other one with position channels."""
    skeleton = motion.skeleton
    channels = []
    for joint, end_site in enumerate(skeleton.end_sites):
        turns = tuple(f"{axis}rotation" for axis in orders[joint % len(orders)])
        slides = ("Xposition", "Yposition", "Zposition") if joint % 2 == 0 else ()
        channels.append(() if end_site else turns + slides)
    return replace(motion, skeleton=replace(skeleton, channels=tuple(channels)))


def test_any_rotation_order_on_any_joint(bvhio, tmp_path):
    motion = with_orders(dance(), ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"])
    assert_same(from_bvhio(to_bvhio(motion)), motion)
    bvhio.writeBvh(str(tmp_path / "out.bvh"), to_bvhio(motion))
    assert_same(read_bvh(tmp_path / "out.bvh"), motion)
    assert_same(from_bvhio(bvhio.readAsBvh(str(tmp_path / "out.bvh"))), motion)


@pytest.mark.parametrize("axes", ["X", "Y", "Z", "XY", "ZX", "YZ"])
def test_joints_with_fewer_channels(axes, bvhio, tmp_path):
    angles = np.linspace(0, 1, 5 * len(axes)).reshape(5, len(axes))
    rotations = Rotation.from_euler(axes, angles).as_quat()
    channels = ((), tuple(f"{axis}rotation" for axis in axes), ())
    plain = tree_of([[0, 0, 0], [1, 2, 3], [3, 2, 1]], ["a", "b", "b_End"], ends=["b_End"])
    skeleton = replace(plain, channels=channels)
    still = np.tile([0.0, 0.0, 0.0, 1.0], (5, 1))
    motion = Motion.of_translations(
        skeleton, np.tile(skeleton.offsets, (5, 1, 1)), np.stack([still, rotations, still], axis=1), "0.01"
    )
    assert_same(from_bvhio(to_bvhio(motion)), motion)
    bvhio.writeBvh(str(tmp_path / "out.bvh"), to_bvhio(motion))
    assert_same(read_bvh(tmp_path / "out.bvh"), motion)


@pytest.mark.usefixtures("bvhio")
def test_joints_in_any_order_come_back_depth_first():
    skeleton = tree_of(np.arange(12.0).reshape(4, 3), "abcd", [-1, 0, 0, 1])
    again = from_bvhio(to_bvhio(swaying(skeleton))).skeleton
    assert [name for name, end_site in zip(again.names, again.end_sites, strict=True) if not end_site] == list("abdc")


def test_a_joint_without_end_site_gets_one(bvhio):
    skeleton = tree_of([[0, 0, 0], [1, 2, 3]], "ab")
    again = from_bvhio(to_bvhio(swaying(skeleton))).skeleton
    assert again.names == ("a", "b", "b_End")
    assert again.offsets[2].tolist() == [0, 0, 0]
    container = bvhio.BvhContainer(bvhio.BvhJoint("a"), 0, 1)
    assert from_bvhio(container).skeleton.offsets.tolist() == [[0, 0, 0], [0, 1, 0]]


@pytest.mark.usefixtures("bvhio")
def test_keyframes_beyond_the_last_frame_do_not_count():
    motion = dance()
    container = to_bvhio(motion)
    container.FrameCount = 7
    np.testing.assert_allclose(from_bvhio(container).positions, motion.positions[:7], atol=1e-5)


@pytest.mark.parametrize("text", ["0.0333333", ".0083333", "8.3333E-3", "1"])
@pytest.mark.usefixtures("bvhio")
def test_the_frame_time_keeps_its_value(text):
    container = to_bvhio(replace(dance(), frame_time_text=text))
    assert container.FrameTime == float(text)
    container.FrameTime = np.float32(container.FrameTime)
    assert from_bvhio(container).frame_time == np.float32(text)


REFUSED = {
    "no container": (lambda container: container.Root, MotionError, "found a BvhJoint"),
    "no root": (lambda container: changed(container, Root=None), MotionError, "Root is None"),
    "no frame count": (lambda container: changed(container, FrameCount=None), MotionError, "FrameCount is None"),
    "too many frames": (lambda container: changed(container, FrameCount=99), MotionError, "20 keyframes, .* 99 frames"),
    "no frame time": (lambda container: changed(container, FrameTime=None), MotionError, "FrameTime is None"),
    "frame time 0": (lambda container: changed(container, FrameTime=0.0), MotionError, "FrameTime is 0.0"),
    "unknown channel": (lambda container: first(container, Channels=["xRotation"]), SkeletonError, "'xRotation'"),
    "repeated channel": (lambda container: first(container, Channels=["Xrotation"] * 2), SkeletonError, "twice"),
    "twins": (lambda container: first(container, Name="LeftHip"), SkeletonError, "'Hips/LeftHip'"),
    "offset not finite": (lambda container: first(container, Offset=[np.nan] * 3), SkeletonError, "not finite"),
    "no rotation": (lambda container: first_key(container, Rotation=(0, 0, 0, 0)), MotionError, "'Chest'"),
    "position not finite": (lambda container: first_key(container, Position=(0, np.inf, 0)), MotionError, "'Chest'"),
}


def changed(prop, **values):
    for name, value in values.items():
        setattr(prop, name, value)
    return prop


def first(container, **values):
    changed(next(child for child in container.Root.Children if child.Name == "Chest"), **values)
    return container


def first_key(container, **values):
    changed(next(child for child in container.Root.Children if child.Name == "Chest").Keyframes[3], **values)
    return container


@pytest.mark.parametrize(("change", "error", "message"), REFUSED.values(), ids=REFUSED)
@pytest.mark.usefixtures("bvhio")
def test_containers_that_are_no_motion_are_refused(change, error, message):
    container = change(to_bvhio(dance()))
    with pytest.raises(error, match=message) as caught:
        from_bvhio(container)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("ends", ["bc", "b"])
@pytest.mark.usefixtures("bvhio")
def test_end_sites_that_bvhio_would_drop_are_refused(ends):
    skeleton = tree_of(np.eye(3), "abc", [-1, 0, 0], ends=ends)
    with pytest.raises(SkeletonError, match="only where a joint has nothing else; 'a' has 'b', 'c'"):
        to_bvhio(swaying(skeleton))


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e39])
@pytest.mark.usefixtures("bvhio")
def test_values_beyond_float32_are_refused(value):
    motion = dance()
    translations = motion.translations
    translations[3, 0, 1] = value
    with pytest.raises(MotionError, match=r"not finite, or beyond 3\.4e"):
        to_bvhio(Motion.of_translations(motion.skeleton, translations, motion.rotations, motion.frame_time_text))


@pytest.mark.parametrize("call", [lambda: to_bvhio(dance()), lambda: from_bvhio(None)])
def test_without_bvhio_the_error_says_what_to_install(call, monkeypatch):
    monkeypatch.setitem(sys.modules, "bvhio", None)
    with pytest.raises(MissingPackageError, match=r"pip install bvhio, with Python 3\.13 or older") as caught:
        call()
    assert len(str(caught.value).splitlines()) == 1
