"""The zoo: every trait occurs, every clip finds hands, feet and head, and a clip on its own body is the clip."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import product

import numpy as np
import pytest
from bodies import CORPUS, SAMPLES, matched, needs_corpus, sample, swaying
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from zoo import BUILDS, FEET, HANDS, HELPERS, LYING, MEMBERS, NAMING, POSES, ROOTS, member, on_member

from distretarget import Motion, RetargetResult, read_bvh, retarget
from distretarget.body.anatomy import SIDES
from distretarget.body.axes import axis_vector
from distretarget.body.body import Body

CLIPS = sorted(path.stem for path in SAMPLES.glob("*.bvh"))
FRAMES = 60  # of each sample clip, enough for two steps of the walk
CORPUS_FRAMES = 200
OFF = 1e-3  # how far a joint may be off in a clip on its own body [body heights]
ROUGHER = 0.01  # how far the jerk may be off [relative]
LANDMARKS = ("head", "leftHand", "rightHand", "leftFoot", "rightFoot")
ROOTED = ("bandai", "unreal", "puppet", "centre_of_mass")
FILES = (
    "animated_drawings/jesse_dance.bvh",
    "bvhio/example.bvh",
    "cmu_daz/14_04.bvh",
    "cmu_mb/05_12.bvh",
    "makehuman/tpose.bvh",
    "makehuman_old/12_03.bvh",
    "pybvh/bvh_test2.bvh",
    "pybvh/bvh_test3.bvh",
    "pybvh/rotation_first_root.bvh",
    "synthetic_odd/odd_dup_names.bvh",
    "synthetic_odd/odd_frames_1.bvh",
    "synthetic_odd/odd_joint_without_channels.bvh",
    "synthetic_odd/odd_no_end_sites.bvh",
    "synthetic_odd/odd_pos_on_every_joint.bvh",
    "synthetic_odd/odd_root_offset_absolute_pos.bvh",
    "synthetic_odd/odd_z_up.bvh",
    "synthetic_odd/odd_zero_offset_joints.bvh",
)
"""Files that differ in what a clip on its own body may stumble over; the benchmark `zoo_quality.py` has all."""

Carry = Callable[[Motion], Motion]

members = pytest.mark.parametrize("name", MEMBERS)


@cache
def clip(name: str) -> Motion:
    return sample(name)[:FRAMES]


@cache
def motion_of(name: str, sample: str = "walk") -> Motion:
    """The motion of a member of the zoo: a sample clip retargeted to it."""
    return retarget(clip(sample), member(name)).motion


def assert_is_the_clip(result: RetargetResult) -> None:
    """Every joint of the body is where the source has it, and moves as smoothly."""
    body = result.matching.target
    joints = body.regions.of_joint >= 0
    expected, found = (motion.positions[:, joints] for motion in (result.source, result.motion))
    np.testing.assert_allclose(found, expected, rtol=0, atol=OFF * body.height)
    assert jerk(found) == pytest.approx(jerk(expected), rel=ROUGHER)


def jerk(points: NDArray[np.float64]) -> float:
    """The mean third difference of points (frames, joints, 3); 0 for fewer than four frames."""
    return float(np.linalg.norm(np.diff(points, n=3, axis=0), axis=-1).mean()) if len(points) > 3 else 0.0


def carried(motion: Motion, path: NDArray[np.float64], turns: NDArray[np.float64]) -> Motion:
    """The same motion below a root, the parent of the hips, that takes another path, (frames, 3), and turns about the
    vertical by other angles, (frames,) [rad]; its child makes up for that.
    """
    world = Rotation.from_quat(motion.world_rotations[:, 1])
    root = Rotation.from_rotvec(np.multiply.outer(turns, axis_vector(motion.skeleton.up or "Y")))
    translations, rotations = motion.translations, np.array(motion.rotations)
    translations[:, 0], rotations[:, 0] = path, root.as_quat()
    translations[:, 1] = root.inv().apply(motion.positions[:, 1] - path)
    rotations[:, 1] = (root.inv() * world).as_quat()
    return Motion.of_translations(motion.skeleton, translations, rotations, motion.frame_time_text)


def still(motion: Motion) -> Motion:
    """The same motion below a root that stays at the origin."""
    return carried(motion, np.zeros((len(motion), 3)), np.zeros(len(motion)))


def wandering(motion: Motion) -> Motion:
    """The same motion below a root that swings to and fro and turns."""
    time = np.linspace(0.0, 4.0, len(motion))
    size = Body.of(motion.skeleton).height
    return carried(motion, np.multiply.outer(np.sin(time), [0.2 * size, 0.0, 0.0]), 0.7 * time)


def stretching(motion: Motion) -> Motion:
    """The same motion, with bones that grow and shrink by 2 %."""
    factors = 1.0 + 0.02 * np.sin(np.linspace(0.0, 6.0, len(motion)))
    translations = motion.translations
    translations[:, 1:] *= factors[:, None, None]
    return Motion.of_translations(motion.skeleton, translations, motion.rotations, motion.frame_time_text)


roots = pytest.mark.parametrize("root", [still, wandering])
# ---- the bodies


def test_every_trait_occurs() -> None:
    members = MEMBERS.values()
    assert {traits.convention for traits in members} == set(NAMING)
    assert {traits.pose for traits in members} == {*POSES, *LYING}
    assert {build for traits in members for build in traits.builds} == set(BUILDS)
    assert {traits.foot for traits in members} == set(FEET)
    assert {traits.fingers for traits in members} == set(HANDS)
    assert {traits.root for traits in members} == set(ROOTS)
    assert {helper for traits in members for helper in traits.helpers} == set(HELPERS)


@members
def test_it_is_recognised_and_stands_with_both_feet_on_the_floor(name: str) -> None:
    body = Body.of(member(name))
    assert body.anatomy is not None
    assert body.up == MEMBERS[name].up
    assert body.stands_at_rest == (MEMBERS[name].pose not in LYING)
    if body.stands_at_rest:
        heights = (body.skeleton.rest_positions + body.skeleton.offsets[0]) @ axis_vector(body.up)
        for side in ("left", "right"):
            foot = body.skeleton.subtree(body.anatomy.roles[f"{side}Foot"])
            assert 0.0 < heights[foot].min() < 0.02 * body.height


@members
def test_every_clip_drives_hands_feet_and_head(name: str) -> None:
    sample = CLIPS[[*MEMBERS].index(name) % len(CLIPS)]  # which all have the same body
    matching = matched(clip(sample), member(name))
    source, target = matching.source.anatomy, matching.target.anatomy
    assert source is not None
    assert target is not None
    for role in LANDMARKS:
        assert matching.drivers[target.roles[role]] == source.roles[role]


@members
def test_a_motion_of_a_member_moves_as_the_clip_does(name: str) -> None:
    """Its limbs point as the clip's do, whatever the rest pose."""
    motion = on_member(name, clip("walk"))
    bodies = Body.of_motion(motion), Body.of_motion(clip("walk"))
    assert motion.skeleton.keys == member(name).keys
    assert [body.up for body in bodies] == [MEMBERS[name].up, "Y"]
    for side, (upper, lower) in product(SIDES, (("UpperArm", "LowerArm"), ("UpperLeg", "LowerLeg"))):
        bones = [body.in_motion.bone(side + upper, side + lower) for body in bodies if body.in_motion]
        heights = [bone @ axis_vector(body.up) for body, bone in zip(bodies, bones, strict=True) if bone is not None]
        np.testing.assert_allclose(*heights, atol=1e-3)


# ---- a clip on its own body


@members
def test_a_clip_on_its_own_body_is_the_clip(name: str) -> None:
    motion = motion_of(name, ("walk", "clap")[[*MEMBERS].index(name) % 2])
    assert_is_the_clip(retarget(motion, motion))
    assert_is_the_clip(retarget(motion, motion.skeleton))


@members
def test_so_is_one_in_which_every_joint_turns(name: str) -> None:
    motion = swaying(member(name), angle=0.3)
    assert_is_the_clip(retarget(motion, motion.skeleton))


@roots
@pytest.mark.parametrize("name", ROOTED)
def test_so_is_one_whose_hips_slide_below_the_root(name: str, root: Carry) -> None:
    """On the skeleton as the motion shows it, and as the file has it."""
    motion = root(motion_of(name))
    for target in (motion, member(name)):
        assert_is_the_clip(retarget(motion, target))


@pytest.mark.parametrize("name", ["mixamo", "xsens"])
def test_feet_rest_where_the_clip_has_them_though_its_bones_stretch(name: str) -> None:
    motion = stretching(motion_of(name))
    result = retarget(motion, motion)
    resting = result.supports.weights > 1 - 1e-9
    off = result.motion.positions[:, result.supports.joints] - motion.positions[:, result.supports.joints]
    assert resting.any()
    assert np.linalg.norm(off, axis=-1)[resting].max() < 0.005 * result.matching.target.height


@needs_corpus
@pytest.mark.parametrize("path", FILES)
def test_so_is_a_real_one(path: str) -> None:
    motion = read_bvh(CORPUS / path)[:CORPUS_FRAMES]
    assert_is_the_clip(retarget(motion, motion))
    assert_is_the_clip(retarget(motion, motion.rigid_skeleton))
