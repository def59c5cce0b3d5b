"""Bodies and motions at the edge of what can be computed: a sound result, or an error of one line."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from bodies import WAYS, lengthened, moved, other_lengths, person, swaying, tree_of
from bvh_texts import format_bvh
from scipy.spatial.transform import Rotation

from distretarget import DistretargetError, Motion, Options, retarget
from distretarget.io.bvh import parse_bvh
from distretarget.pipeline.options import OBJECTIVES

BODY = person()
TARGET = other_lengths(BODY)
CLIP = swaying(BODY, frames=6)
ORDERS = ["".join(order) for order in itertools.permutations("XYZ")]
POSITIONS = ("Xposition", "Yposition", "Zposition")

objectives = pytest.mark.parametrize("objective", OBJECTIVES)


def is_sound(source, target, joint_map=None, **options):
    """Check that a clip is retargeted to finite positions on exact bones, and that its text is read back the same."""
    result = retarget(source, target, Options(**options), joint_map=joint_map)
    motion = result.motion
    again = parse_bvh(format_bvh(motion), "again.bvh")
    assert len(again) == len(source)
    order = list(target.depth_first)  # of joints in the text
    for read, joints in ((motion, range(len(target))), (again, order)):
        assert np.all(np.isfinite(read.positions))
        lengths = np.linalg.norm(read.translations, axis=2)[:, 1:]
        np.testing.assert_allclose(lengths, [target.lengths[list(joints)][1:]] * len(source), rtol=1e-9, atol=0)
    size = max(np.abs(motion.positions).max(), target.lengths.max())
    np.testing.assert_allclose(again.positions, motion.positions[:, order], rtol=0, atol=1e-7 * size)
    assert all(value is None or np.isfinite(value) for value in result.metrics["result"].values())
    return result


def is_sound_or_refused(source, target, **options):
    """Check that a clip is retargeted soundly, or refused in one line."""
    refusal = ""
    try:
        is_sound(source, target, **options)
    except DistretargetError as error:
        refusal = str(error)
    assert "\n" not in refusal


@objectives
@pytest.mark.parametrize("exponent", range(-9, 10, 3))
def test_targets_of_every_size(exponent, objective):
    is_sound(CLIP, TARGET.with_offsets(TARGET.offsets * 10.0**exponent), objective=objective)


@pytest.mark.parametrize("exponent", [-12, 9, 11])
def test_single_bones_of_every_length(exponent):
    lengths = np.array(TARGET.lengths)
    lengths[TARGET.index("LeftElbow")] = 10.0**exponent
    is_sound_or_refused(CLIP, TARGET.with_lengths(lengths))


@objectives
@pytest.mark.parametrize(
    ("parents", "offsets"),
    [
        ([-1], np.zeros((1, 3))),
        ([-1, 0], np.array([[0.0, 0, 0], [0, 1, 0]])),
        (np.arange(40) - 1, np.tile([0.0, 1.0, 0.0], (40, 1))),
        (np.r_[-1, np.zeros(200, int)], np.random.default_rng(0).normal(size=(201, 3))),
        (np.r_[-1, np.zeros(9, int)], np.zeros((10, 3))),
    ],
    ids=["one joint", "two joints", "a chain", "a star of 200", "all in one place"],
)
def test_trees_that_are_no_bodies(parents, offsets, objective):
    skeleton = tree_of(offsets, parents=parents)
    is_sound_or_refused(swaying(skeleton, frames=3), skeleton.with_offsets(2.0 * skeleton.offsets), objective=objective)


@objectives
@pytest.mark.parametrize("bone", ["LeftKnee", "LeftElbow", "LeftHip", "Head"])
@pytest.mark.parametrize("side", ["source", "target"])
def test_a_bone_of_length_0_on_one_side(bone, side, objective):
    def without(skeleton):
        lengths = np.array(skeleton.lengths)
        lengths[skeleton.index(bone)] = 0.0
        return skeleton.with_lengths(lengths)

    if side == "source":
        is_sound(swaying(without(BODY), frames=4), TARGET, objective=objective)
    else:
        is_sound(CLIP, without(TARGET), objective=objective)


@objectives
def test_clips_that_do_not_move(objective):
    frozen = CLIP[np.zeros(6, int)]
    unturned = np.tile(BODY.rest_rotations, (6, 1, 1))
    t_pose = Motion(BODY, np.zeros((6, 3)), unturned, "0.01")
    stilted = lengthened(BODY, {"Knee": 1.2, "Ankle": 0.8, "Elbow": 1.4})
    for clip in (frozen, t_pose):
        positions = is_sound(clip, stilted, objective=objective).motion.positions
        np.testing.assert_allclose(positions, positions[[0] * 6], atol=1e-3)
    one = CLIP[:1]
    is_sound(one, TARGET, objective=objective)


@objectives
def test_a_spike_in_one_frame(objective):
    path = np.array(CLIP.root_positions)
    path[3, 1] = 1e6
    is_sound(replace(CLIP, root_positions=path), TARGET, objective=objective)


def test_large_angles():
    text = format_bvh(CLIP)
    head, frames = text[: text.index("Frame Time")], text[text.index("Frame Time") :].splitlines()
    rows = [np.array(row.split(), float) for row in frames[1:]]
    wound = [" ".join(map(repr, [*row[:3].tolist(), *(row[3:] + 5040.0).tolist()])) for row in rows]
    clip = parse_bvh("\n".join([head + frames[0], *wound]), "wound.bvh")
    np.testing.assert_allclose(clip.positions, parse_bvh(text, "clip.bvh").positions, atol=1e-9)
    is_sound(clip, TARGET)


@pytest.mark.parametrize("order", ORDERS)
def test_gimbal_lock_at_every_order(order):
    channels = tuple(f"{axis}rotation" for axis in order)
    turning = [channels if own else () for own in TARGET.channels]
    in_order = replace(TARGET, channels=((*POSITIONS, *channels), *turning[1:]))
    locked = np.array(CLIP.rotations)
    angles = np.radians([[10.0, sign * 90.0, turn] for turn, sign in itertools.product((0.0, 20.0, 40.0), (1, -1))])
    locked[:, ~BODY.end_sites] = Rotation.from_euler(order, angles).as_quat()[:, None]
    is_sound(replace(CLIP, rotations=locked), in_order)


@pytest.mark.parametrize("way", WAYS[::4], ids=range(len(WAYS[::4])))
def test_a_source_that_stands_lies_or_hangs(way):
    is_sound(moved(CLIP, way), TARGET)


@objectives
@pytest.mark.parametrize("far", [1e4, 1e6])
def test_a_source_far_from_the_origin(far, objective):
    here = is_sound(CLIP, TARGET, objective=objective, root_scale=1.0)
    there = is_sound(moved(CLIP, Rotation.identity(), (far, 0.0, far)), TARGET, objective=objective, root_scale=1.0)
    shift = there.motion.positions - here.motion.positions
    np.testing.assert_allclose(shift, np.broadcast_to([far, 0.0, far], shift.shape), atol=1e-8 * far + 1e-3)


@pytest.mark.filterwarnings("error")
@objectives
def test_a_source_that_drives_the_root_alone(objective):
    """So no bone of the target is carried by what is driven."""
    nobody = dict.fromkeys(BODY.names[1:])
    is_sound(CLIP, TARGET, joint_map={BODY.names[0]: BODY.names[0], **nobody}, objective=objective)


@objectives
def test_a_joint_without_channels_that_the_source_turns_does_not_turn(objective):
    """It carries bones, and nothing can be written of how it turns."""
    joint = BODY.index("Chest2")
    stiff = replace(TARGET, channels=[() if j == joint else channels for j, channels in enumerate(TARGET.channels)])
    result = is_sound(CLIP, stiff, objective=objective)
    np.testing.assert_allclose(result.motion.rotations[:, joint], [[0, 0, 0, 1]] * len(CLIP), atol=1e-9)
