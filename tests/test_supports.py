"""Supports: what rests on the world in the source stays at rest, at its height, on bodies of other proportions."""

from functools import cache

import numpy as np
import pytest
from bodies import SAMPLES, lengthened
from sample_supports import FLOOR, SUPPORTED, WORLD
from scipy.spatial.transform import Rotation

from distretarget import Options, load_target, read_bvh, retarget

H = {"Chest": 0.8, "Chest2": 0.8, "Chest3": 0.8, "Elbow": 0.75, "Wrist": 0.75, "Knee": 1.15, "Ankle": 1.15}
FEET = ("Ankle", "Toe", "Toe_End")
ELSEWHERE = (*FEET, "Hips")  # feet have tests of their own, and a seat rests on the hip joints
ENDS_LATER = 0.35  # a joint that sets off slowly may rest so much longer than it stands still [s]
BODY_MOVES = 5.0  # a body that moves less than this shows no hold [cm]
STANDING = sorted(path.stem for path in SAMPLES.glob("*.bvh") if path.stem not in SUPPORTED)

samples = pytest.mark.parametrize("name", SUPPORTED)
targets = pytest.mark.parametrize("body", ["child", "H"])


@cache
def source(name):
    return read_bvh(SAMPLES / "supports" / f"{name}.bvh" if name in SUPPORTED else SAMPLES / f"{name}.bvh")


def target(body):
    if body == "H":
        return lengthened(source("walk").rigid_skeleton, H)
    return load_target(SAMPLES / f"{body}.json").for_source(source("walk").rigid_skeleton).skeleton


@cache
def on(name, body, supports="hold"):
    return retarget(source(name), target(body), Options(supports=supports))


def known(name, kinds):
    """Frames and joints of the known supports of these kinds, but for the feet's."""
    return [each for each in SUPPORTED[name]().supports if each.kind in kinds and not each.joint.endswith(ELSEWHERE)]


@samples
def test_the_known_supports_are_found_and_no_others(name):
    held, keys = on(name, "child").supports, source(name).skeleton.keys
    rests = dict(zip([keys[joint] for joint in held.joints], (held.weights > 0.99).T, strict=True))
    later = round(ENDS_LATER / source(name).frame_time)
    before = np.arange(len(source(name))) < later  # a joint may have rested before the clip begins
    near = {key: before.copy() for key in rests}
    for support in known(name, ("floor", "world")):
        if support.joint in near:
            near[support.joint][max(support.first - later, 0) : support.last + 1 + later] = True
        shoulders = source(name).positions[support.first : support.last + 1, keys.index("Neck")]
        if support.kind == WORLD and np.ptp(shoulders, axis=0).max() < BODY_MOVES:
            continue  # nothing shows that the hand holds on to something
        assert rests[support.joint][support.first : support.last + 1].all(), support
    for key, frames in rests.items():
        if not key.endswith(FEET):
            assert not (frames & ~near[key]).any(), key


@samples
@targets
def test_what_rests_does_not_slide(name, body):
    motion = on(name, body).motion
    leg = on(name, body).matching.leg_lengths[1]
    for support in known(name, ("floor", "world")):
        places = motion.positions[support.first : support.last + 1, motion.skeleton.index(support.joint)]
        assert np.ptp(places, axis=0).max() < 0.01 * leg, support


@samples
@targets
def test_what_rests_on_the_floor_is_as_high_as_in_the_source(name, body):
    result = on(name, body)
    for support in known(name, (FLOOR,)):
        frames, joint = slice(support.first, support.last + 1), result.motion.skeleton.index(support.joint)
        heights, expected = (motion.positions[frames, joint, 1] for motion in (result.motion, result.source))
        assert np.abs(heights - result.root_scale * expected).max() < 0.015 * result.matching.leg_lengths[1], support


@samples
@targets
def test_nothing_goes_under_the_floor(name, body):
    result = on(name, body)
    heights = result.motion.positions[..., 1] - result.root_scale * result.source.positions[..., 1].min()
    assert heights.min() > -0.015 * result.matching.leg_lengths[1]


@samples
@pytest.mark.parametrize("rig", ["mixamo_t", "unreal_t"])
def test_fingers_that_nothing_drives_do_not_go_under_the_floor(name, rig):
    result = retarget(source(name), load_target(SAMPLES / "rigs" / f"{rig}.json"))
    matching, regions = result.matching, result.matching.regions
    hands = [regions.names.index(f"{side} hand") for side in ("left", "right")]
    fingers = np.flatnonzero(np.isin(regions.of_joint, hands) & (matching.drivers < 0))
    up = matching.source.up_vector
    floor = result.root_scale * (result.source.positions @ up).min()
    assert len(fingers) > 30
    assert (result.motion.positions[:, fingers] @ up).min() - floor > -0.02 * matching.leg_lengths[1]


@pytest.mark.parametrize("name", STANDING)
@targets
def test_where_nothing_rests_but_feet_the_result_is_that_of_feet_alone(name, body):
    both = (on(name, body, supports).motion for supports in ("hold", "feet"))
    one, other = (motion.rotations.tobytes() + motion.translations.tobytes() for motion in both)
    assert one == other


@samples
def test_on_the_same_body_the_clip_stays_as_it_is(name):
    result = retarget(source(name), source(name))
    size = result.matching.target.height
    np.testing.assert_allclose(result.motion.positions, source(name).positions, atol=1e-3 * size)


def test_in_a_scaled_environment_a_hand_on_a_wall_has_the_scaled_place_of_the_sources():
    """The wall is there on the target's side too, in its scale; else the hand rests where the body has it."""
    for environment in ("scaled", "body"):
        result = retarget(source("hand_on_wall"), target("H"), Options(environment=environment))
        held, joint = result.supports, result.motion.skeleton.index("RightWrist")
        column = held.joints.tolist().index(joint)
        rests = held.weights[:, column] > 0.99
        expected = result.root_scale * result.source.positions[rests][:, result.matching.drivers[joint]]
        off = np.linalg.norm(held.places[rests, column] - expected, axis=1).max()
        assert rests.sum() > 100
        assert off < 1e-9 if environment == "scaled" else off > 5.0


def test_free_supports_and_those_of_feet_alone_hold_less():
    joints = {supports: len(on("push_up", "child", supports).supports.joints) for supports in ("hold", "feet", "free")}
    assert joints["hold"] > joints["feet"] == 4
    assert joints["free"] == 0


@pytest.mark.parametrize("arms", [0.2, 0.5])
def test_a_body_whose_arms_are_too_short_for_the_floor_sits_upright(arms):
    found = retarget(source("sit"), lengthened(source("walk").rigid_skeleton, {"Elbow": arms, "Wrist": arms}))
    sits = found.supports.weights[:, found.supports.feet :].min(axis=1) > 0.99
    chest = found.motion.skeleton.names.index("Chest")
    copied, result = (
        Rotation.from_quat(motion.world_rotations_of(chest)[sits]) for motion in (found.rotation_copy, found.motion)
    )
    assert sits.sum() > 50
    assert np.degrees((result * copied.inv()).magnitude()).max() < 25
