"""Feet with a mesh: its lowest vertices stand on the floor, whatever soles and heels no joint shows."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from bodies import HERO, PERSON, SAMPLES, UP
from capsule_bodies import capsule_surface, mesh_of
from scipy.spatial.transform import Rotation

from distretarget import Body, Options, load_target, read_bvh, retarget
from distretarget.body.build import average_build
from distretarget.body.resting import feet_at_rest
from distretarget.body.soles import floor_height, level_on_floor
from distretarget.target import Target

BALL = 0.02
"""The height of the ball of the foot over its sole [m]."""
HEIGHT = 1.7
PARTS = ("Ankle", "Toe")


def block(low, high):
    """The corners of a box."""
    return np.array(list(product(*zip(low, high, strict=True)))), np.zeros((0, 3), np.intp)


def shod(heel=0.0, platform=0.0):
    """The person in shoes with a heel and a platform of these heights [m]: feet point down from the ankle to the toe by
    as much as the heel is high, and soles are blocks below heel and toe.
    """
    offsets = np.array(PERSON.offsets)
    toes = [PERSON.index(f"{side}Toe") for side in ("Left", "Right")]
    offsets[toes] += [0.0, -heel, 0.0]
    skeleton = PERSON.with_offsets(offsets)
    surfaces = []
    for ankle, toe in zip((PERSON.index(f"{side}Ankle") for side in ("Left", "Right")), toes, strict=True):
        x, y, z = skeleton.rest_positions[toe]
        floor, behind = y - BALL - platform, skeleton.rest_positions[ankle][2]
        surfaces.append((ankle, block((x - 0.02, floor, behind - 0.08), (x + 0.02, floor + 0.03, behind - 0.04))))
        surfaces.append((toe, block((x - 0.04, floor, z - 0.02), (x + 0.04, floor + 0.02, z + 0.06))))
    return with_mesh(skeleton, mesh_of(surfaces))


def with_mesh(skeleton, mesh):
    return Target(skeleton, {}, "shod", mesh=lambda: mesh, capsules=average_build("adult").on(Body.of(skeleton)))


def bound_on_tiptoe(target, pitch):
    """The same target in a bind pose in which each foot points farther down by a pitch [degrees]."""
    turn, skeleton, mesh = Rotation.from_euler("X", pitch, degrees=True), target.skeleton, target.mesh()
    offsets, vertices = np.array(skeleton.offsets), np.array(mesh.vertices)
    for side in ("Left", "Right"):
        ankle = skeleton.index(f"{side}Ankle")
        feet, place = skeleton.subtree(ankle), skeleton.rest_positions[ankle]
        offsets[feet[1:]] = turn.apply(offsets[feet[1:]])
        on = np.isin(mesh.joints[:, 0], feet)
        vertices[on] = turn.apply(vertices[on] - place) + place
    return with_mesh(skeleton.with_offsets(offsets), replace(mesh, vertices=vertices))


def lowest(target, result):
    """(frames, legs, parts), the heights of the lowest vertices of what ankle and toe carry; and whether the source's
    ankle and toe rest, (frames, legs).
    """
    mesh, legs = target.mesh(), result.matching.legs
    heights = [
        [mesh.posed(result.motion, np.flatnonzero(mesh.joints[:, 0] == joint))[..., 1].min(axis=1) for joint in leg]
        for leg in ((each.ankle, each.toe) for each in legs[1])
    ]
    rests = [feet_at_rest(result.source, leg, UP, result.matching.leg_lengths[0]).all(axis=1) for leg in legs[0]]
    return np.transpose(heights, (2, 0, 1)), np.transpose(rests)


def sample(name):
    return read_bvh(SAMPLES / f"{name}.bvh")[:160:2]


@pytest.mark.parametrize("clip", ["walk", "squat"])
@pytest.mark.parametrize(("heel", "platform"), [(0.0, 0.0), (0.09, 0.0), (0.03, 0.12)])
def test_heel_and_ball_of_any_shoe_stand_on_the_floor(clip, heel, platform):
    target = shod(heel, platform)
    result = retarget(sample(clip), target)
    heights, flat = lowest(target, result)
    assert np.abs(np.median(heights[flat], axis=0)).max() < 0.002 * HEIGHT
    assert np.percentile(np.abs(heights[flat].min(axis=1)), 95) < 0.003 * HEIGHT
    assert heights[flat].min() > -0.005 * HEIGHT
    assert result.metrics["result"]["foot_height"] < 0.5


@pytest.mark.parametrize(
    ("heel", "platform", "pitch"), [(0.4, 0.0, 0.0), (0.35, 0.1, 0.0), (0.0, 0.0, 20.0), (0.09, 0.03, 30.0)]
)
def test_shoes_stand_on_their_soles_however_feet_point_in_the_bind_pose(heel, platform, pitch):
    """A shoe's foot bone may point nearly straight down, and a bind pose may stand on tiptoe."""
    target = bound_on_tiptoe(shod(heel, platform), pitch)
    result = retarget(sample("squat"), target)
    heights, flat = lowest(target, result)
    assert flat.any()
    assert np.abs(np.median(heights[flat], axis=0)).max() < 0.002 * HEIGHT
    assert result.metrics["result"]["sole_tilt"] < 1.0


def test_a_foot_without_a_flat_sole_stands_as_its_joints_show():
    surfaces = []
    for side in ("Left", "Right"):
        ankle, toe = (PERSON.rest_positions[PERSON.index(f"{side}{part}")] for part in PARTS)
        surfaces.append((PERSON.index(f"{side}Ankle"), capsule_surface((ankle, toe), (0.04, 0.03))))
    result = retarget(sample("squat"), with_mesh(PERSON, mesh_of(surfaces)))
    assert result.matching.target_normals is None


@pytest.mark.parametrize("radii", [(0.02, 0.02), (0.03, 0.02)])
def test_hips_are_calm_over_feet_without_a_heel(radii):
    """As toes lift, the skin of a foot that is a tube along its bone comes off the floor."""
    skeleton = shod(heel=0.09).skeleton
    surfaces = []
    for side in ("Left", "Right"):
        ankle, toe = (skeleton.index(f"{side}{part}") for part in PARTS)
        surfaces.append((ankle, capsule_surface(skeleton.rest_positions[[ankle, toe]], radii)))
    target = with_mesh(skeleton, mesh_of(surfaces))
    result = retarget(read_bvh(SAMPLES / "walk.bvh"), target)
    metrics = result.metrics
    assert metrics["result"]["hips_acceleration"] < 2.0 * metrics["rotation_copy"]["hips_acceleration"]
    assert metrics["result"]["foot_skate"] < 0.06
    assert metrics["result"]["floor"] < 0.5


@pytest.mark.parametrize("factor", [1.0, 100.0])
def test_on_the_same_rig_legs_and_trunk_stay_wherever_feet_are(factor):
    """Feet that tilt, and stand a little over the floor, stay so where nothing has to be adapted."""
    hero = load_target(HERO)
    clip = retarget(sample("walk"), hero).motion
    body, turns = Body.of(clip.skeleton), np.array(clip.rotations)
    feet, arms = [leg.ankle for leg in body.legs], [body.skeleton.subtree(arm.top) for arm in body.arms]
    turns[:, feet] = (
        (Rotation.from_quat(turns[:, feet].reshape(-1, 4)) * Rotation.from_euler("X", 6, degrees=True))
        .as_quat()
        .reshape(len(clip), -1, 4)
    )
    source = replace(clip, rotations=turns).moved(0.03 * np.array(UP))
    result = retarget(source.scaled(factor), hero)
    np.testing.assert_allclose(result.rotation_copy.positions, source.positions, atol=1e-6)
    own = np.setdiff1d(np.arange(len(body.skeleton)), np.concatenate([[*arm] for arm in arms]))
    np.testing.assert_allclose(result.motion.positions[:, own], source.positions[:, own], atol=1e-6)


def exported(motion):
    """A motion as Blender writes it to BVH: along Z, and with End Sites that continue bones, toes into the floor."""
    turned = motion.with_rest_turned(Rotation.from_euler("X", 90, degrees=True))
    skeleton = turned.skeleton
    tops = [joint for joint in range(len(skeleton)) if not skeleton.children[joint]]
    longer = replace(
        skeleton,
        names=(*skeleton.names, *(f"{skeleton.names[top]}_End" for top in tops)),
        parents=np.append(skeleton.parents, tops),
        offsets=np.vstack([skeleton.offsets, skeleton.offsets[tops]]),
        channels=(*skeleton.channels, *((),) * len(tops)),
        end_sites=np.append(skeleton.end_sites, np.ones(len(tops), bool)),
    )
    still = np.tile([0.0, 0.0, 0.0, 1.0], (len(motion), len(tops), 1))
    return replace(turned, skeleton=longer, rotations=np.hstack([turned.rotations, still]))


def test_an_exported_rig_is_the_same_rig():
    hero = load_target(HERO)
    clip = retarget(sample("walk"), hero).motion
    result, plain = retarget(exported(clip), hero), retarget(clip, hero)
    assert result.matching.is_same_rig
    np.testing.assert_allclose(result.motion.positions, plain.motion.positions, atol=1e-4)


def test_a_platform_lifts_the_whole_body_by_its_height():
    plain, high = (retarget(sample("squat"), shod(platform=platform)).motion for platform in (0.0, 0.1))
    np.testing.assert_allclose(high.rotations, plain.rotations, atol=1e-6)
    np.testing.assert_allclose(
        high.root_positions - plain.root_positions, 0.1 * np.tile(UP, (len(plain), 1)), atol=1e-6
    )


def test_without_skin_the_mesh_is_ignored():
    target = shod(heel=0.09)
    bare = retarget(sample("walk"), target, Options(skin="none")).motion
    of_joints = retarget(sample("walk"), target.skeleton).motion
    np.testing.assert_array_equal(bare.rotations, of_joints.rotations)
    np.testing.assert_array_equal(bare.root_positions, of_joints.root_positions)


@pytest.mark.parametrize("rise", [0.0, 9.0])
@pytest.mark.parametrize("clip", ["walk", "clap"])
def test_a_character_stands_on_its_mesh_at_height_0(clip, rise):
    source, target = sample(clip), load_target(HERO)
    source = type(source)(source.skeleton, source.root_positions + rise * UP, source.rotations, source.frame_time_text)
    result = retarget(source, target)
    mesh, legs = target.mesh(), result.matching.legs
    rests = np.stack([feet_at_rest(result.source, leg, UP, 1.0).any(axis=1) for leg in legs[0]], axis=1)
    heights = mesh.posed(result.motion)[..., 1].min(axis=1)
    assert np.abs(heights[rests.any(axis=1)]).max() < 0.005 * HEIGHT


def test_a_level_floor_is_seen_through_soles_that_wander():
    """The source's floor rises and falls by two hundredths of a leg from one step to the next."""
    source = sample("walk")
    wave = 0.02 * 85.0 * np.sin(np.arange(len(source)) / 12.0)
    source = type(source)(source.skeleton, source.root_positions + np.outer(wave, UP), source.rotations, "0.02")
    target = shod()
    result = retarget(source, target)
    heights, flat = lowest(target, result)
    assert np.percentile(np.abs(heights[flat].min(axis=1)), 90) < 0.003 * HEIGHT
    assert result.metrics["result"]["hips_height"] < 0.25  # the hips follow the foot that rests, not one in the air


def test_soles_on_a_slope_or_on_steps_stay_and_those_on_a_level_floor_lie_on_it():
    frames, all_rest = np.arange(100.0), np.ones((100, 2), bool)
    slope, steps = (np.stack([heights, heights], axis=1) for heights in (frames * 0.01, frames // 20 * 0.2))
    for heights in (slope, steps):
        np.testing.assert_allclose(level_on_floor(heights, np.median(heights), all_rest, 1.0), heights, atol=1e-12)
    wander = np.stack([0.02 * np.sin(frames), -0.02 * np.cos(frames)], axis=1)
    np.testing.assert_allclose(level_on_floor(5.0 + wander, 5.0, all_rest, 1.0), 5.0)
    onto_box = np.where(frames[:, None] < 80, wander, 0.4 + wander)
    np.testing.assert_allclose(level_on_floor(onto_box, 0.0, all_rest, 1.0)[:80], 0.0, atol=1e-12)
    np.testing.assert_allclose(level_on_floor(onto_box, 0.0, all_rest, 1.0)[80:], onto_box[80:])


def test_the_floor_is_between_two_feet_that_disagree():
    soles, rests = np.array([[1.0, 3.0], [1.0, 3.0], [1.0, 9.0]]), np.array([[True, True], [True, True], [True, False]])
    assert floor_height(soles, rests) == 2.0
    assert floor_height(soles, rests & False) == np.inf
