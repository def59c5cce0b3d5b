"""Motions in files of arrays: parameters of SMPL and positions of joints."""

import numpy as np
import pytest
from bodies import SAMPLES, moved, person, sample, swaying
from program import run, succeeded
from scipy.spatial.transform import Rotation

from distretarget import FileError, SkeletonError, load_target, read_bvh, read_motion, retarget, write_npz
from distretarget.io.smpl import HANDS, MODELS, SmplBody, smpl_parameters

PLACES = {  # of the left half of a body, about as SMPL's [m]
    "pelvis": (0, -0.22, 0.03),
    "left_hip": (0.07, -0.31, 0.02),
    "spine1": (0, -0.11, 0),
    "left_knee": (0.1, -0.69, 0.02),
    "spine2": (0, 0.03, 0),
    "left_ankle": (0.09, -1.09, -0.02),
    "spine3": (0, 0.08, 0.03),
    "left_foot": (0.12, -1.14, 0.1),
    "neck": (0, 0.29, -0.01),
    "left_collar": (0.08, 0.19, 0),
    "head": (0, 0.37, 0.04),
    "left_shoulder": (0.17, 0.22, -0.02),
    "left_elbow": (0.43, 0.21, -0.05),
    "left_wrist": (0.68, 0.22, -0.05),
    "left_hand": (0.76, 0.21, -0.06),
    "jaw": (0, 0.35, 0.08),
    "left_eye_smplhf": (0.03, 0.43, 0.1),
}
FINGERS = {"index": 0.02, "middle": 0.0, "pinky": -0.05, "ring": -0.03, "thumb": 0.04}  # how far in front [m]


def place(name):
    if name.startswith("right"):
        return np.array([-1, 1, 1]) * place(name.replace("right", "left"))
    if name in HANDS:
        return np.add(PLACES["left_wrist"], [0.05 + 0.03 * int(name[-1]), 0, FINGERS[name[5:-1]]])
    return np.array(PLACES[name])


def joints_of(count):
    return np.array([place(name) for name in MODELS[count]])


def parameters(count, frames=12, angle=0.4, seed=0):
    """Poses of a body that stands in a world with Z up, and its path."""
    rng = np.random.default_rng(seed)
    poses = rng.normal(0, angle, (frames, 3 * count))
    poses[:, :3] = rng.normal([0.5 * np.pi, 0, 0], 0.2, (frames, 3))
    return poses, rng.normal(0, 1, (frames, 3))


@pytest.fixture
def folder(tmp_path):
    for count in MODELS:
        np.savez(tmp_path / f"joints{count}.npz", J=joints_of(count))
    return tmp_path


def angles(a, b):
    one, other = (Rotation.from_rotvec(np.reshape(poses, (-1, 3))) for poses in (a, b))
    return (one.inv() * other).magnitude()


@pytest.mark.parametrize("count", [24, 52, 55])
def test_parameters_come_back(folder, count):
    poses, trans = parameters(count)
    np.savez(folder / "clip.npz", poses=poses, trans=trans, betas=np.zeros(16), gender="male", mocap_framerate=120.0)
    motion = read_motion(folder / "clip.npz", skeleton=folder / f"joints{count}.npz")
    back = smpl_parameters(motion)
    assert angles(poses, back["poses"]).max() < 1e-6
    np.testing.assert_allclose(back["trans"], trans, atol=1e-9)
    assert back["mocap_frame_rate"] == 120.0
    write_npz(folder / "again.npz", motion)
    with np.load(folder / "again.npz") as arrays:
        assert angles(poses, arrays["poses"]).max() < 1e-6


def test_parameters_turn_joints_as_the_model_does(folder):
    poses, trans = np.zeros((1, 72)), np.array([[1.0, 2.0, 3.0]])
    poses[0, :3] = [0.5 * np.pi, 0, 0]  # the model stands in a world with Z up ...
    poses[0, 3 * MODELS[24].index("left_shoulder") + 2] = -0.5 * np.pi  # ... and lowers its left arm
    np.savez(folder / "clip.npz", poses=poses, trans=trans, mocap_frame_rate=30)
    motion = read_motion(folder / "clip.npz", skeleton=folder / "joints24.npz")
    x = dict(zip(motion.skeleton.names, motion.positions[0], strict=True))
    pelvis = trans[0] + place("pelvis")
    np.testing.assert_allclose(x["pelvis"], [pelvis[0], pelvis[2], -pelvis[1]])  # Y is up where Z was
    np.testing.assert_allclose(x["head"] - x["pelvis"], place("head") - place("pelvis"), atol=1e-12)
    arm = place("left_elbow") - place("left_shoulder")
    np.testing.assert_allclose(x["left_elbow"] - x["left_shoulder"], [arm[1], -arm[0], arm[2]], atol=1e-12)


@pytest.mark.parametrize("heading", [90, 180])
@pytest.mark.parametrize("clip", ["crawl", "cartwheel"])
@pytest.mark.parametrize("up", ["Y", "Z"])
def test_the_floor_shows_the_up_axis_where_the_body_does_not_stand(folder, up, clip, heading):
    source = read_bvh(SAMPLES / "supports" / f"{clip}.bvh")[::4]
    turn = Rotation.from_euler("Y", heading, degrees=True)
    motion = moved(retarget(source, load_target(folder / "joints24.npz")).motion, turn)
    saved = smpl_parameters(motion)
    poses, trans = saved["poses"], saved["trans"]
    if up == "Y":
        to_y, pelvis = Rotation.from_euler("X", -90, degrees=True), place("pelvis")
        poses[:, :3] = (to_y * Rotation.from_rotvec(poses[:, :3])).as_rotvec()
        trans = to_y.apply(trans + pelvis) - pelvis
    np.savez(folder / "clip.npz", poses=poses, trans=trans, mocap_framerate=15)
    read = read_motion(folder / "clip.npz", skeleton=folder / "joints24.npz")
    np.testing.assert_allclose(read.positions, motion.positions, atol=1e-6)


def test_parameters_in_parts_and_of_the_body_alone(folder):
    poses, trans = parameters(22)
    np.savez(folder / "a.npz", poses=poses, trans=trans, mocap_framerate=30)
    np.savez(folder / "b.npz", root_orient=poses[:, :3], pose_body=poses[:, 3:], trans=trans, fps=[30])
    one, other = (read_motion(folder / f"{name}.npz", skeleton=folder / "joints52.npz") for name in "ab")
    np.testing.assert_array_equal(one.rotations, other.rotations)


def test_a_model_gives_the_joints_of_each_shape(folder):
    rest, taller = joints_of(24), joints_of(24) * [1, 1.1, 1]
    shapes = np.stack([taller - rest, np.zeros_like(rest)], axis=-1)
    np.savez(folder / "model.npz", v_template=rest, shapedirs=shapes, J_regressor=np.eye(24))
    poses, trans = parameters(24, frames=2)
    np.savez(folder / "clip.npz", poses=poses, trans=trans, betas=[1.0, 0.0, 5.0], mocap_framerate=30)
    motion = read_motion(folder / "clip.npz", skeleton=folder / "model.npz")
    np.testing.assert_allclose(motion.skeleton.offsets[0], taller[0])
    assert load_target(folder / "model.npz").skeleton.offsets[0] == pytest.approx(rest[0])


@pytest.mark.parametrize("rig", ["lafan1_a", "mixamo_a", "xsens_t"])
def test_a_body_of_other_names_and_rest_pose_takes_parameters(folder, rig):
    poses, trans = parameters(24, angle=0.3)
    np.savez(folder / "clip.npz", poses=poses, trans=trans, mocap_framerate=30)
    exact = read_motion(folder / "clip.npz", skeleton=folder / "joints24.npz")
    motion = read_motion(folder / "clip.npz", skeleton=SAMPLES / "rigs" / f"{rig}.json")
    one, other = SmplBody.of(exact.skeleton), SmplBody.of(motion.skeleton)
    for upper, lower in (("left_shoulder", "left_elbow"), ("right_elbow", "right_wrist"), ("left_hip", "left_knee")):
        a, b = (
            each.positions[:, body.joints[lower]] - each.positions[:, body.joints[upper]]
            for each, body in ((exact, one), (motion, other))
        )
        cosines = (a * b).sum(axis=1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
        assert cosines.min() > np.cos(np.radians(8))
    assert not other.exact
    assert smpl_parameters(motion) == {}


def test_the_program_reads_and_writes_parameters(folder):
    poses, trans = parameters(24, frames=8, angle=0.1)
    np.savez(folder / "clip.npz", poses=poses, trans=trans, mocap_framerate=30)
    joints = folder / "joints24.npz"
    out = folder / "out.npz"
    assert (
        run("retarget", folder / "clip.npz", joints, "-o", out, "--skeleton", joints, "--supports", "free").returncode
        == 0
    )
    with np.load(out) as arrays:
        assert angles(poses, arrays["poses"]).max() < 0.05
        np.testing.assert_allclose(arrays["trans"], trans, atol=0.02)


@pytest.mark.parametrize("unit", [1.0, 0.01])
def test_positions_of_a_motion_give_them_back(tmp_path, unit):
    clip = sample("clap")
    joints = list(clip.skeleton.joints)
    np.save(tmp_path / "clip.npy", unit * clip.positions[:, joints])
    found = read_motion(tmp_path / "clip.npy", fps=60, skeleton=SAMPLES / "clap.bvh")
    size = clip.skeleton.longest_path
    np.testing.assert_allclose(found.positions[:, joints], clip.positions[:, joints], atol=1e-6 * size)
    assert found.frame_time == pytest.approx(1 / 60)
    assert found.moving is None


def test_limbs_twist_as_elbows_and_knees_show(tmp_path):
    clip = sample("squat")
    np.savez(tmp_path / "clip.npz", positions=clip.positions, frame_time=clip.frame_time)
    found = read_motion(tmp_path / "clip.npz", skeleton=SAMPLES / "squat.bvh")
    for name in ("LeftHip", "RightHip"):
        joint = clip.skeleton.index(name)
        one, other = (Rotation.from_quat(each.world_rotations_of(joint)) for each in (clip, found))
        assert np.degrees((one.inv() * other).magnitude()).max() < 15


def test_noisy_positions_give_rigid_bones_that_keep_their_distances(tmp_path):
    body = person()
    clip = swaying(body, frames=10)
    noisy = clip.positions + np.random.default_rng(0).normal(0, 0.01, clip.positions.shape)
    np.savez(tmp_path / "clip.npz", here=noisy[:, ::-1], names=body.keys[::-1], fps=30)
    np.savez(tmp_path / "body.npz", names=body.keys, parents=body.parents, offsets=body.offsets)
    found = read_motion(tmp_path / "clip.npz", skeleton=tmp_path / "body.npz")
    bones = np.linalg.norm(found.bones[:, 1:], axis=2)
    np.testing.assert_allclose(bones, np.tile(body.lengths[1:], (10, 1)), atol=1e-9)
    assert np.sqrt(((found.positions - clip.positions) ** 2).sum(axis=2)).mean() < 0.02


@pytest.mark.parametrize("rotations", ["quaternion", "matrix", "6d"])
def test_what_the_program_writes_comes_back_without_a_skeleton(tmp_path, rotations):
    clip = swaying(person(), frames=5)
    write_npz(tmp_path / "clip.npz", clip, rotations=rotations)
    found = read_motion(tmp_path / "clip.npz")
    np.testing.assert_allclose(found.positions, clip.positions, atol=1e-12)
    assert found.skeleton.keys == clip.skeleton.keys


CLAP = SAMPLES / "clap.bvh"
CHAIN = {"names": ["a", "b"], "parents": [-1, 0], "offsets": np.eye(3)[:2], "root_path": np.zeros((2, 3)), "fps": 30}


@pytest.mark.parametrize(
    ("arrays", "given", "message"),
    [
        ({"poses": np.zeros((2, 72)), "trans": np.zeros((2, 3)), "fps": 30}, {}, "expected skeleton=FILE"),
        ({"poses": np.zeros((2, 72)), "trans": np.zeros((3, 3)), "fps": 30}, {"skeleton": CLAP}, "trans is float64 of"),
        ({"poses": np.zeros((2, 70)), "trans": np.zeros((2, 3)), "fps": 30}, {"skeleton": CLAP}, "70 numbers in each"),
        ({"poses": np.zeros((2, 72)), "fps": 30}, {"skeleton": CLAP}, "has no 'trans'"),
        ({"poses": np.zeros((2, 72)), "trans": np.zeros((2, 3))}, {"skeleton": CLAP}, "expected fps=NUMBER"),
        ({"positions": np.zeros((2, 7, 3)), "fps": 30}, {"skeleton": CLAP}, "has positions of 7 joints"),
        ({"positions": np.full((2, 7, 3), np.nan), "fps": 30}, {"skeleton": CLAP}, "expected finite numbers"),
        ({"positions": np.zeros((0, 22, 3)), "fps": 30}, {"skeleton": CLAP}, "positions has no frames; expected one"),
        (
            {"positions": np.full((2, 22, 3), 1e300), "fps": 30},
            {"skeleton": CLAP},
            r"contains 1e\+300; expected finite",
        ),
        ({"positions": np.full((2, 22, 3), -(2**63)), "fps": 30}, {"skeleton": CLAP}, r"contains 9\.22e\+18; expected"),
        ({"poses": np.zeros((0, 72)), "trans": np.zeros((0, 3)), "fps": 30}, {"skeleton": CLAP}, "poses has no frames"),
        ({"poses": np.full((2, 72), 1e300), "fps": 30}, {"skeleton": CLAP}, r"poses contains 1e\+300"),
        ({**CHAIN, "local_rotations": np.zeros((2, 2, 4))}, {}, "has no rotations, but quaternions of zeros"),
        ({**CHAIN, "local_rotations": np.ones((2, 2, 5))}, {}, r"expected numbers of shape \(frames, joints, 4\)"),
        ({**CHAIN, "local_rotations": np.ones((0, 2, 4))}, {}, "local_rotations has no frames"),
        ({"names": np.array([None]), "positions": np.zeros((2, 1, 3)), "fps": 30}, {"skeleton": CLAP}, "not a whole"),
        ({"a": np.zeros(3), "fps": 30}, {"skeleton": CLAP}, "has 'a', 'fps'; expected positions"),
    ],
)
def test_faults_are_named(tmp_path, arrays, given, message):
    np.savez(tmp_path / "clip.npz", **arrays)
    with pytest.raises(FileError, match=message):
        read_motion(tmp_path / "clip.npz", **given)


def test_a_body_without_the_joints_of_smpl_is_refused(tmp_path):
    poses, trans = parameters(24)
    np.savez(tmp_path / "clip.npz", poses=poses, trans=trans, fps=30)
    np.savez(tmp_path / "joints.npz", J=np.zeros((7, 3)))
    with pytest.raises(FileError, match="has 7 joints; expected one of 22, 24, 52, 55"):
        read_motion(tmp_path / "clip.npz", skeleton=tmp_path / "joints.npz")
    np.savez(tmp_path / "chain.npz", names=["a", "b"], parents=[-1, 0], offsets=np.eye(3)[:2])
    with pytest.raises(SkeletonError, match="is not recognised as human"):
        read_motion(tmp_path / "clip.npz", skeleton=tmp_path / "chain.npz")


@pytest.mark.parametrize("cut", [10, 100, 300])
def test_a_cut_file_is_refused(tmp_path, cut):
    np.savez(tmp_path / "clip.npz", poses=np.zeros((2, 72)))
    (tmp_path / "clip.npz").write_bytes((tmp_path / "clip.npz").read_bytes()[:cut])
    with pytest.raises(FileError, match="not a whole file of arrays"):
        read_motion(tmp_path / "clip.npz", skeleton=CLAP)
    path = tmp_path / "clip.npy"
    np.save(path, np.zeros((2, 22, 3)))
    path.write_bytes(path.read_bytes().replace(b"(2, 22, 3)", b"(((((((((("))
    with pytest.raises(FileError, match="not a whole file of arrays"):
        read_motion(path, fps=30, skeleton=CLAP)


def test_arrays_are_refused_by_their_headers_and_no_others_are_read(tmp_path, monkeypatch):
    """A compressed array of zeros is a thousandth of its size."""
    read, path = [], tmp_path / "clip.npz"
    of_file = np.lib.format.read_array
    monkeypatch.setattr(np.lib.format, "read_array", lambda *of, **how: read.append(of_file(*of, **how)) or read[-1])
    places = read_bvh(CLAP).positions[:4]
    np.savez_compressed(path, places=places, unused=np.zeros((4, 10**6)), fps=30)
    assert len(read_motion(path, skeleton=CLAP)) == 4
    assert {array.shape for array in read} == {places.shape, ()}
    np.savez_compressed(path, positions=np.zeros((100_000, 22, 3), np.uint8), fps=30)
    with pytest.raises(FileError, match=r"positions has the shape \(100000, 22, 3\): more numbers than a file of"):
        read_motion(path, skeleton=CLAP)
    assert len(read) == 3


def test_a_folder_of_parameters_is_retargeted(folder):
    (folder / "amass").mkdir()
    poses, trans = parameters(24, frames=4, angle=0.1)
    np.savez(folder / "amass" / "walk_poses.npz", poses=poses, trans=trans, mocap_framerate=30)
    given = folder / "amass", SAMPLES / "rigs" / "lafan1_t.json", "-o", folder / "out"
    joints = "--skeleton", folder / "joints24.npz"
    succeeded("batch", *given, *joints, "--jobs", 1)
    assert len(read_bvh(folder / "out" / "walk_poses.bvh")) == 4
    assert "1 done before" in run("batch", *given, *joints, "--jobs", 1).stdout
    np.savez(folder / "joints24.npz", J=1.1 * joints_of(24))
    assert "1 done before" not in run("batch", *given, *joints, "--jobs", 1).stdout
