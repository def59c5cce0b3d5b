"""Vectors, rotations, how near joints come, and values over time: against numpy, scipy and known answers."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import lengthened, matched, moved, person, posed, sample, swaying
from scipy import ndimage
from scipy.spatial.transform import Rotation

from distretarget import retarget
from distretarget.baseline.rotation_copy import RootScale
from distretarget.ik.curvature import factorise, solve_factored
from distretarget.numerics.joint_pairs import least_distances
from distretarget.numerics.moving import averaged, largest
from distretarget.numerics.quaternions import least_rotation
from distretarget.numerics.rotations import best_rotation, least, least_matrix
from distretarget.numerics.time_series import (
    find_shots,
    median_of_three,
    opening,
    run_means,
    runs_of,
    smoothed,
    smoothed_steps,
    widened,
)
from distretarget.numerics.vectors import angles_between, cross, extent, farthest_points, lengths, level, normalised
from distretarget.objectives.clip import Clip

VECTORS = np.random.default_rng(0).normal(size=(2, 5, 7, 3))


def test_lengths_extents_and_cross_products_are_numpys():
    a = VECTORS[0]
    np.testing.assert_allclose(lengths(a), np.linalg.norm(a, axis=-1), rtol=1e-15)
    assert lengths(np.zeros((0, 3))).shape == (0,)
    assert extent(np.array([[1.0, -3.0], [2.0, 0.5]])) == extent(np.array([3.0, -2.0])) == 3.0
    assert extent(np.zeros((0, 3))) == 0.0
    assert np.isnan(extent(np.array([1.0, np.nan])))
    assert extent(np.array([-np.inf])) == np.inf
    np.testing.assert_array_equal(normalised(np.array([[0.0, 3, 4], [0, 0, 0]])), [[0, 0.6, 0.8], [0, 0, 0]])
    a, b = VECTORS[..., :3]
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))
    np.testing.assert_array_equal(cross(a, b[0, 0]), np.cross(a, b[0, 0]))


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, np.pi / 2, np.pi - 1e-9, np.pi])
def test_angles_between_vectors_of_any_length_are_exact(angle):
    """Also where a cosine would lose them, near 0 and 180 degrees."""
    turned = Rotation.from_rotvec([0, 0, angle]).apply([3.0, 0, 0])
    assert angles_between(np.array([0.2, 0, 0]), turned) == pytest.approx(angle, rel=1e-12)


def test_a_vector_of_no_length_is_at_no_angle():
    assert angles_between(np.zeros(3), VECTORS[0, 0, 0]) == 0
    up = normalised(np.array([1.0, 2, 2]))
    flat = level(VECTORS[0], up)
    np.testing.assert_allclose(flat @ up, 0, atol=1e-15)
    np.testing.assert_allclose(np.cross(VECTORS[0] - flat, up), 0, atol=1e-15)


def test_the_ends_of_a_line_come_first_then_its_middle():
    line = np.linspace(0, 1, 101)[:, None]
    assert farthest_points(line, 3).tolist() == [0, 100, 50]
    assert sorted(farthest_points(np.eye(3), 10).tolist()) == [0, 1, 2]


@pytest.mark.parametrize("a", [(0, 0, 2.0), (1.0, -2.0, 0.5), (1.0, 1.0, 1.0), (0, -3.0, 0)])
def test_opposite_directions_are_half_a_turn_apart(a):
    a = np.array([a])
    turn = Rotation.from_quat(least_rotation(a, -2.5 * a))
    np.testing.assert_allclose(turn.magnitude(), np.pi)
    np.testing.assert_allclose(turn.apply(a), -a, atol=1e-12)


def test_the_least_rotation_is_that_of_scipy_and_turns_no_zero_vector():
    a, b = np.random.default_rng(1).normal(size=(2, 5, 1, 3))
    np.testing.assert_array_equal(best_rotation(a, b), least_rotation(a[:, 0], b[:, 0]))
    none, some = np.zeros((1, 3)), np.ones((1, 3))
    for a, b in ((none, some), (some, none), (none, none)):
        np.testing.assert_array_equal(least_rotation(a, b), [[0, 0, 0, 1]])
    a, b = np.random.default_rng(0).normal(size=(2, 40, 3))
    found = Rotation.from_quat(least_rotation(a, b))
    expected = Rotation.concatenate([Rotation.align_vectors(b[n], a[n])[0] for n in range(len(a))])
    np.testing.assert_allclose((found * expected.inv()).magnitude(), 0, atol=1e-7)


@pytest.mark.parametrize("vectors", [1, 2, 5])
def test_the_matrix_is_that_of_the_rotation(vectors):
    for a, b in np.random.default_rng(2).normal(size=(10, 2, vectors, 3)):
        np.testing.assert_allclose(least_matrix(a, b), least(a, b).as_matrix(), atol=1e-14)


@pytest.mark.parametrize("zeros", [[], [(0, 1)], [(0, 1), (0, 2)], [(0, 1), (0, 2), (1, 2)]])
def test_the_factor_solves_what_the_curvature_multiplies(zeros):
    """With blocks of zeros, too."""
    draw = np.random.default_rng(0)
    half = draw.normal(size=(9, 9))
    H = half @ half.T + 30.0 * np.eye(9)
    for p, q in zeros:
        for row, column in ((p, q), (q, p)):
            H[3 * row : 3 * row + 3, 3 * column : 3 * column + 3] = 0.0
    U, active = H.copy(), np.array([0, 2, 3])
    factorise(U, 9)
    factor = np.triu(U, 1) + np.diag(1 / np.diag(U))
    np.testing.assert_allclose(factor.T @ factor, H)
    gradient, d = draw.normal(size=(2, 5, 3))
    solve_factored(U, active, gradient, d, np.empty(9))
    np.testing.assert_allclose(H @ d[active].ravel(), gradient[active].ravel())
    np.testing.assert_array_equal(d[[1, 4]], 0)


ONE, OTHER = np.array([0]), np.array([1])
TAU = np.array([2.0])


def distances_of(x, shots=None, y=0.0):
    """D and the least D, (frames,) each, of a point in the origin and one at x, (frames,), and y."""
    points = np.zeros((len(x), 2, 3))
    points[:, 1, 0], points[:, 1, 1] = x, y
    shots = np.zeros(len(x), np.intp) if shots is None else np.array(shots, np.intp)
    D, least = least_distances(points, points, ONE, OTHER, TAU, shots)
    return D[:, 0], least[:, 0]


def test_what_passes_between_two_frames_is_as_near_as_it_comes_but_not_across_a_cut():
    D, least = distances_of(np.array([-0.5, -0.3, -0.1, 0.1, 0.3, 0.5]), y=0.04)
    np.testing.assert_allclose(D, np.hypot([0.5, 0.3, 0.1, 0.1, 0.3, 0.5], 0.04) / 2)
    np.testing.assert_allclose(least, np.hypot([0.4, 0.2, 0.0, 0.0, 0.2, 0.4], 0.04) / 2)
    D, least = distances_of(np.array([0.3, 0.2, 0.2, 0.2, 0.4]))
    np.testing.assert_allclose(least[1:4], D[1:4])
    x, shots = np.array([-0.4, -0.4, -0.2, 0.2, 0.4]), [0, 0, 0, 1, 1]
    assert distances_of(x)[1][2] == distances_of(x)[1][3] == 0.0
    np.testing.assert_allclose(distances_of(x, shots)[1][2:4], 0.1)


@pytest.mark.parametrize(("usual", "spike"), [(0.9, 0.0), (0.1, 0.9)])
def test_a_single_frame_that_jumps_counts_for_nothing_and_several_do(usual, spike):
    x = np.full(9, 2 * usual)
    x[4] = 2 * spike
    np.testing.assert_allclose(distances_of(x)[1], usual)
    x[3:6] = 2 * spike
    assert distances_of(x)[1][4] == pytest.approx(spike)


def test_a_motion_comes_as_near_at_any_frame_rate():
    """Two swings a second past a point, at 240, 120, 60 and 30 frames a second."""
    for late in (0.0, 0.003, 0.011):
        nearest = []
        for rate in (240, 120, 60, 30):
            t = np.arange(rate) / rate + late
            nearest.append(distances_of(np.cos(4 * np.pi * t), y=0.05)[1].min())
        np.testing.assert_allclose(nearest, 0.025, atol=0.003)


NOISE = np.random.default_rng(0).uniform(0, 1, (80, 3))


@pytest.mark.parametrize("frames", [0, 0.4, 1, 2.6, 20, 200])
def test_widened_values_are_nowhere_less_and_within_the_range(frames):
    wide = widened(NOISE, frames)
    assert np.all(wide >= NOISE - 1e-12)
    assert np.all(wide <= NOISE.max(axis=0) + 1e-12)
    assert np.array_equal(wide, NOISE) == (frames < 0.5)


@pytest.mark.parametrize("reach", [1, 5])
def test_a_pulse_widens_by_twice_the_reach_to_both_sides(reach):
    pulse = np.zeros((61, 1))
    pulse[30] = 1.0
    wide = widened(pulse, reach)[:, 0]
    assert wide[30] == pytest.approx(1.0)
    np.testing.assert_array_equal(np.flatnonzero(wide > 1e-12), np.arange(30 - 2 * reach, 30 + 2 * reach + 1))
    np.testing.assert_allclose(wide, wide[::-1], atol=1e-15)
    assert np.all(np.diff(wide[:31]) >= -1e-15)


@pytest.mark.parametrize("frames", [0, 1, 4, 11])
def test_what_lasts_is_the_opening_of_morphology(frames):
    size = 2 * round(frames / 2) + 1
    opened = ndimage.grey_opening(NOISE, size=(size, 1), mode="nearest")
    np.testing.assert_array_equal(opening(NOISE, frames), opened)
    np.testing.assert_array_equal(opening(NOISE[::-1], frames), opened[::-1])


@pytest.mark.parametrize("reach", [0, 1, 7, 100])
def test_largest_values_and_means_are_those_of_windows(reach):
    padded = np.pad(NOISE, ((reach, reach), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis=0)
    np.testing.assert_array_equal(largest(NOISE, reach), windows.max(axis=2))
    weights = np.hanning(2 * reach + 3)[1:-1]
    np.testing.assert_allclose(averaged(NOISE, reach), np.average(windows, axis=2, weights=weights), rtol=1e-13)


@pytest.mark.parametrize("frames", [1, 2, 3, 80])
def test_medians_and_runs_are_those_of_scipy(frames):
    noise, flags = NOISE[:frames], NOISE[:frames] > 0.5
    for values in (noise, flags):
        expected = ndimage.median_filter(values, (3, 1), mode="nearest")
        np.testing.assert_array_equal(median_of_three(values), expected)
    np.testing.assert_array_equal(runs_of(flags[:, 0]), ndimage.label(flags[:, 0])[0])


def test_runs_have_their_means_and_lines_between_them_each_column_for_itself():
    values = np.array([9.0, 1.0, 3.0, 9.0, 9.0, 9.0, 8.0, 9.0])[:, None]
    weights = np.array([0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.0])
    np.testing.assert_allclose(run_means(values, weights)[:, 0], [2, 2, 2, 3.5, 5, 6.5, 8, 8])
    np.testing.assert_allclose(run_means(np.array([[1.0], [3.0]]), np.zeros(2)), [[2.0], [2.0]])
    alone = averaged(NOISE[:, :1], 5)
    np.testing.assert_array_equal(averaged(NOISE, 5)[:, :1], alone)
    assert averaged(np.zeros((9, 4, 3)), 2).shape == (9, 4, 3)


def test_a_smoothed_series_keeps_lines_and_bends_between_known_values():
    frames = np.arange(200.0)
    line = np.stack([0.5 * frames - 3.0, np.ones(200)], axis=1)
    np.testing.assert_allclose(smoothed(line, np.full(200, 0.3), 12.0), line, atol=1e-8)
    known = (np.abs(frames - 100) > 50).astype(float)
    bent = smoothed(np.where(frames < 100, 1.0, 2.0)[:, None], known, 5.0)
    np.testing.assert_allclose(bent[[10, 190], 0], [1.0, 2.0], atol=1e-3)
    assert np.abs(np.diff(bent[:, 0], 2)).max() < 0.02
    np.testing.assert_array_equal(smoothed(line, np.zeros(200), 12.0), line)
    draw = np.random.default_rng(0)
    values, weights = draw.normal(size=(30, 2)), draw.uniform(0.1, 2.0, 30)
    differences = np.diff(np.eye(30), 2, axis=0)
    expected = np.linalg.solve(np.diag(weights) + 3.0**4 * differences.T @ differences, weights[:, None] * values)
    np.testing.assert_allclose(smoothed(values, weights, 3.0), expected, atol=1e-9)


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_short_series_are_smoothed_and_steadied(frames):
    values = np.arange(2.0 * frames).reshape(frames, 2)
    assert np.all(np.isfinite(smoothed(values, np.ones(frames), 10.0)))
    np.testing.assert_allclose(smoothed_steps(values, np.ones(frames), np.zeros(frames)), values)


def test_a_steadied_series_is_the_mean_where_it_is_stiff_and_free_where_it_is_not():
    values, stiffness = np.random.default_rng(0).normal(size=(60, 3)), np.full(60, 1e9)
    stiffness[39] = 0.0
    steady = smoothed_steps(values, np.ones(60), stiffness)
    for part in (slice(40), slice(40, 60)):
        np.testing.assert_allclose(
            steady[part], np.broadcast_to(values[part].mean(axis=0), steady[part].shape), atol=1e-5
        )


LENGTH = 0.888


def positions(frames=40):
    return swaying(person(), frames).positions


def shots(x, length=LENGTH, frame_time=1.0):
    return find_shots(x, np.arange(x.shape[1]), length, frame_time)


@pytest.mark.parametrize("cut", [1, 2, 17, 39])
def test_a_body_that_jumps_begins_a_shot(cut):
    x = np.array(positions())
    x[cut:] += [0.0, 0.0, 2.0]
    np.testing.assert_array_equal(shots(x), np.arange(40) >= cut)
    np.testing.assert_array_equal(shots(100 * x, 100 * LENGTH), np.arange(40) >= cut)


def test_one_bad_frame_and_small_jumps_are_no_cut():
    x = np.array(positions())
    x[12] += 2.0
    assert shots(x).max() == 0
    still = np.tile(positions()[:1], (40, 1, 1))
    still[20:] += 0.01 * LENGTH / np.sqrt(3)
    assert shots(still).max() == 0


@pytest.mark.parametrize("backwards", [False, True])
def test_frames_that_the_body_leaves_faster_than_anybody_can_are_shots_of_their_own(backwards):
    """A body that rushes to its place within three frames: as seen where a T-pose was put before a motion."""
    x = np.tile(positions()[:1], (40, 1, 1))
    x[:3, :, 2] += np.array([0.9, 0.5, 0.2])[:, None]
    x = x[::-1] if backwards else x
    rushes = np.array([*range(4), *[3] * 36])
    np.testing.assert_array_equal(shots(x, frame_time=0.01), rushes.max() - rushes[::-1] if backwards else rushes)
    assert shots(x).max() == 0


def test_a_body_that_was_too_fast_rushes_until_it_has_slowed_down():
    """Steps of 18, 10 and 4 leg lengths / s: only the first is faster than anybody can be."""
    x = np.tile(positions()[:1], (40, 1, 1))
    x[:3, :, 2] += LENGTH * np.array([0.32, 0.14, 0.04])[:, None]
    np.testing.assert_array_equal(shots(x, frame_time=0.01), [*range(4), *[3] * 36])


@pytest.mark.parametrize(("step", "cuts"), [(0.25, 1), (0.15, 0)])
@pytest.mark.parametrize("backwards", [False, True])
def test_a_first_step_after_which_nobody_can_slow_down_begins_a_shot(step, cuts, backwards):
    """As seen where a T-pose is before a motion of 30 frames/s: steps of so many leg lengths, and then of .1."""
    x = np.tile(positions()[:1], (40, 1, 1))
    x[..., 2] += LENGTH * np.array([0.0, *(step + 0.1 * np.arange(39))])[:, None]
    found = shots(x[::-1] if backwards else x, frame_time=1 / 30)
    np.testing.assert_array_equal(found, cuts * (np.arange(40) > (38 if backwards else 0)))


@pytest.mark.parametrize(("jump", "cuts"), [(0.015, 0), (0.03, 1)])
def test_a_still_person_who_jumps_by_a_fiftieth_of_a_leg_begins_a_shot(jump, cuts):
    path = np.where(np.arange(40) < 20, 1.0, 1.0 + jump * LENGTH)[:, None] * [0.0, 1.0, 0.0]
    still = posed(person(), {}, path)
    assert Clip.of(matched(still, person()), RootScale.even(1.0)).shots.max() == cuts


@pytest.mark.parametrize(
    ("first", "second"), [("walk", "squat"), ("clap", "hands_on_hips"), ("supports/push_up", "supports/crawl")]
)
def test_each_shot_is_retargeted_like_a_clip_of_its_own(first, second):
    """Nothing reaches across a cut: neither contacts, foot lock and other supports nor what smooths them."""
    one, other = (sample(name) for name in (first, second))
    target = lengthened(one.rigid_skeleton, {"Toe": 1.5, "Knee": 0.9, "Wrist": 1.2})
    other = moved(other, Rotation.from_euler("Y", 90, degrees=True), shift=(300.0, 0.0, -200.0))
    both = replace(
        one,
        root_positions=np.concatenate([one.root_positions, other.root_positions]),
        rotations=np.concatenate([one.rotations, other.rotations]),
    )
    result = retarget(both, target)
    expected = np.concatenate([retarget(each, target).motion.positions for each in (one, other)])
    assert np.abs(result.motion.positions - expected).max() < 1e-6 * result.matching.target.height
