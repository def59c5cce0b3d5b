"""How far a result is from the source's floor, on shifts that are known, and on surfaces of two spheres."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import HERO, LEG, SAMPLES, SIDES, UP, matched, person, posed
from capsule_bodies import capsule_surface, mesh_of

from distretarget import load_target, read_bvh, retarget
from distretarget.measure.comparison import Reference
from distretarget.measure.skin import find_surface, surface_of_capsules, surface_of_mesh
from distretarget.measure.supports import NEAR, find_feet, height_errors
from distretarget.skin.capsules import Capsules


@pytest.fixture(scope="module")
def walked():
    return retarget(read_bvh(SAMPLES / "walk.bvh")[:120], load_target(HERO))


def floor_of(result, motion):
    surface = find_surface(motion.skeleton, result.skins.target.capsules, result.mesh)
    return Reference(result.source, result.matching, UP, surface=surface).compare(motion).tracks["floor"]


@pytest.mark.parametrize("rise", [0.05, -0.05, 0.3])
def test_a_shift_of_the_whole_body_is_seen_as_far_as_it_is(walked, rise):
    leg = walked.matching.leg_lengths[1]
    shifted = replace(walked.motion, root_positions=walked.motion.root_positions + rise * leg * UP)
    before, after = floor_of(walked, walked.motion), floor_of(walked, shifted)
    assert before.values[before.counts].mean() < 0.2
    # the source's own sole may be as much as `NEAR` off its floor, and the result as much less
    assert after.values[after.counts].mean() == pytest.approx(100 * abs(rise), abs=1.0)


def test_what_stands_on_a_step_belongs_there_and_what_is_near_the_floor_on_it():
    heights, of_source = np.array([1.5, 1.4, 1.0, 1.04, 0.9]), np.array([1.5, 1.5, 1.05, 1.05, 1.05])
    np.testing.assert_allclose(height_errors(heights, of_source, 1.0), [0.0, -0.1, 0.0, 0.0, -0.1])
    assert height_errors(np.array([1.0]), np.array([1.0 + 1.01 * NEAR]), 1.0) == pytest.approx(-1.01 * NEAR)


@pytest.mark.parametrize(("crouch", "off"), [(0.0, 0.0), (0.05, 5.0)])
def test_hips_over_a_foot_that_comes_to_the_floor_are_right_at_the_source_s_height(crouch, off):
    """For a while the source's left foot stands a little above the floor, that of the result on it."""
    bend = np.where(np.arange(40) < 10, 0.25, 0.0)[:, None] * [1.0, 0.0, 0.0]
    turns = {"LeftHip": -bend, "LeftKnee": 2 * bend, "LeftAnkle": -bend}
    source, flat = (posed(person(), each, np.zeros((40, 3)) + UP) for each in (turns, {}))
    down = np.arccos(1.0 - crouch) * np.array([1.0, 0.0, 0.0])
    knees = {f"{side}{part}": sign * down for side in SIDES for part, sign in (("Hip", -1), ("Knee", 2), ("Ankle", -1))}
    result = posed(person(), knees, np.zeros((40, 3)) + UP - crouch * LEG * UP) if crouch else flat
    hips = Reference(source, matched(source, result), UP).compare(result).tracks["hips_height"]
    assert hips.values[hips.weights > 0].mean() == pytest.approx(off, abs=1.0)
    assert hips.values[5, 0] == pytest.approx(max(off - 3.1, 0.0), abs=0.2)


def test_a_body_that_never_rests_has_no_figure_of_the_floor():
    rising = posed(person(), {}, np.outer(np.arange(30.0), UP))
    assert np.isnan(find_feet(rising, matched(rising, rising), UP).floor)
    assert not Reference(rising, matched(rising, rising), UP).compare(rising).tracks["floor"].counts.any()


def test_the_lowest_point_of_a_surface_is_that_of_the_posed_one(walked):
    mesh, motion = walked.mesh, walked.motion[::20]
    surface, skeleton = surface_of_mesh(mesh, motion.skeleton), motion.skeleton
    foot = skeleton.subtree(walked.matching.legs[1][0].ankle)
    known = mesh.posed(motion, np.flatnonzero(np.isin(mesh.carriers, foot)))[..., 1].min(axis=1)
    np.testing.assert_allclose(surface.lowest(motion, foot, UP), known, atol=2e-3)
    assert np.isinf(surface.lowest(motion, [], UP)).all()


@pytest.mark.parametrize("bends", [True, False])
def test_a_pack_is_no_skin_beside_skin_that_bends(bends):
    """If all pieces are rigid, as of robots, all of them are the body."""
    body, down = person(), np.array([[0.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    chest, lower = body.index("Chest3"), body.index("Chest")
    places = [body.rest_positions[chest] + length * down - (0, 0, length) for length in (0.1, 0.5)]
    mesh = mesh_of([(chest, capsule_surface(place, [0.1, 0.1], 9, 8)) for place in places])
    if bends:
        mesh.joints[0] = lower
    motion = posed(body, {}, np.zeros((2, 3)))
    lowest = surface_of_mesh(mesh, motion.skeleton).without_gear.lowest(motion, [lower, chest], UP)
    np.testing.assert_allclose(lowest, motion.positions[:, chest, 1] - (0.2 if bends else 0.6), atol=2e-3)


def test_the_lowest_point_of_capsules_is_a_radius_below_an_end():
    body = person()
    ends = np.array([[[0.0, 0.0, 0.0], [0.0, -0.4, 0.0]]])
    knee = body.index("LeftKnee")
    capsules = Capsules(np.array([knee]), ends, np.array([[0.1, 0.05]]), np.array([0]))
    motion = posed(body, {"LeftKnee": np.array([np.pi / 2, 0.0, 0.0])}, np.zeros((2, 3)))
    upright = posed(body, {}, np.zeros((2, 3)))
    surface = surface_of_capsules(capsules, body)
    height = upright.positions[:, knee, 1]
    np.testing.assert_allclose(surface.lowest(upright, [knee], UP), height - 0.45)
    np.testing.assert_allclose(surface.lowest(motion, [knee], UP), height - 0.1)
