"""Limbs bend over time: out of the bodies they are in, to what they touch, and smoothly before and after."""

from types import SimpleNamespace

import numpy as np
import pytest
from bodies import posed
from test_displacement import HAND, PERSON, hand_in_belly, standing

from distretarget.ik.limb_bends import FADES, TAU, _Path, bends
from distretarget.ik.limb_terms import Frames, LimbWorkspace, write_terms
from distretarget.numerics.vectors import normalised
from distretarget.objectives.anchors import no_anchors
from distretarget.objectives.skin import floor_below
from distretarget.skin.balls import NEVER, segment_gaps
from distretarget.skin.displacement import displacements
from distretarget.skin.limbs import bent

RATE = 60.0
REACH = 0.1


def frames_of(skin, motion, firmness=0.0, free=1.0):
    """The frames of a motion in which each segment pair is a contact zone of its own, with a target gap of 0."""
    count, pairs = len(motion), len(skin.balls.pairs)
    limbs = np.stack([motion.positions[:, [*limb.joints]] for limb in skin.limbs], axis=1) / skin.unit
    none = np.zeros((count, pairs))
    firm = np.broadcast_to(np.reshape(firmness, (-1, 1)), none.shape)
    free, up = np.full((count, len(skin.limbs), 2), free), np.tile([0.0, 1.0, 0.0], (count, 1))
    moving = skin.posed(motion), limbs, free, none, up, np.full_like(free, NEVER)
    return Frames(*moving, none, firm, **no_anchors(count, len(skin.limbs)))


def solved(skin, motion, firmness=0.0, rate=RATE, **anchors):
    """The displacements of limbs, and the gaps of the bent motion."""
    frames = frames_of(skin, motion, firmness)._replace(**anchors)
    arms = np.array([limb.is_arm for limb in skin.limbs])
    start, _ = displacements(skin.balls, skin.displaced, *frames[:4])
    zones, shots = np.arange(len(skin.balls.pairs)), np.zeros(len(motion), np.intp)
    d = bends(skin.balls, skin.displaced, zones, frames, arms, start, shots, 1.0 / rate, REACH)
    return d, segment_gaps(skin.balls, skin.posed(bent(motion, skin.limbs, skin.unit * d)), 0.2)


def swinging(frames, depth=0.05):
    """A hand that comes to the belly, is in it for a while, and leaves it; and the skin of that body."""
    t = np.linspace(-1.0, 1.0, frames)[:, None]
    still, skin = hand_in_belly(depth)
    turns = {"LeftShoulder": [0, -1.2, 0] + t**2 * [0, 0.8, 0], "LeftElbow": [0, -1.4, 0] + 0.0 * t}
    return posed(PERSON, turns, np.tile(still.root_positions, (frames, 1))), skin


def test_a_limb_that_nothing_acts_on_stays_where_it_is():
    motion, skin = hand_in_belly(-0.05)
    assert not solved(skin, motion[np.zeros(30, int)])[0].any()


def test_a_hand_is_out_of_the_belly_in_every_frame_and_moves_smoothly():
    motion, skin = swinging(120)
    before = segment_gaps(skin.balls, skin.posed(motion), 0.2).min(axis=1)
    d, gaps = solved(skin, motion)
    assert before.min() * skin.unit < -0.04
    assert gaps.min() > -0.003
    deep = before < -0.01
    start, _ = displacements(skin.balls, skin.displaced, *frames_of(skin, motion)[:4])
    bend, sudden = (np.linalg.norm(np.diff(each[:, 0, 1], 2, axis=0), axis=1).max() for each in (d, start))
    assert bend < 0.5 * sudden
    assert np.abs(d[np.flatnonzero(deep)[0] - 3]).max() > 1e-3  # it begins before it would sink in


@pytest.mark.parametrize("are_arms", [True, False])
def test_a_body_may_have_limbs_of_one_kind_alone(are_arms):
    motion, skin = swinging(60)
    frames = frames_of(skin, motion)
    frames = frames._replace(soft=frames.soft - 0.01)  # all is to keep a distance
    arms, zones, shots = np.full(len(skin.limbs), are_arms), np.arange(len(skin.balls.pairs)), np.zeros(60, np.intp)
    start, _ = displacements(skin.balls, skin.displaced, *frames[:4])
    d = bends(skin.balls, skin.displaced, zones, frames, arms, start, shots, 1.0 / RATE, REACH)
    assert segment_gaps(skin.balls, skin.posed(bent(motion, skin.limbs, skin.unit * d)), 0.2).min() > -0.003


def test_a_hand_leaves_the_belly_but_not_through_the_floor():
    motion, skin = swinging(60)
    d, gaps = solved(skin, motion)
    up = -normalised(d[30, 0, 1])
    floor = {"up": np.tile(up, (60, 1)), "above_floor": np.full((60, len(skin.limbs), 2), 0.01)}
    on_floor, gaps_on_floor = solved(skin, motion, **floor)
    assert (d @ up).min() < -0.02
    assert (on_floor @ up).min() > -0.012
    assert gaps_on_floor.min() > gaps.min() - 0.005


def test_no_hand_may_sink_below_the_lowest_skin():
    motion, skin = hand_in_belly()
    heights = [motion.positions[0, PERSON.index(f"{side}Wrist"), 1] - HAND for side in ("Left", "Right")]
    lowest = (skin.posed(motion)[..., 1] - skin.balls.cap_radii).min() * skin.unit  # the right hand's, or the belly's
    clip = SimpleNamespace(up=np.array([0.0, 1.0, 0.0]), frame_time=1.0 / RATE)
    floor = floor_below(skin.balls, skin.displaced, skin.posed(motion), 2, clip)
    np.testing.assert_allclose(floor["above_floor"][0, :, 1] * skin.unit, np.array(heights) - lowest, atol=1e-9)


def test_a_contact_is_closed_from_its_first_frame_to_its_last():
    still, skin = hand_in_belly(-0.02)
    firmness = np.zeros(150)
    firmness[60:90] = 1.0
    d, gaps = solved(skin, still[np.zeros(150, int)], firmness)
    open_by = gaps.min(axis=1) / (0.02 / skin.unit)
    assert abs(open_by[[60, 89]]).max() < 0.2
    assert abs(open_by[75]) < 0.05
    np.testing.assert_allclose(open_by[[0, 149]], 1.0, atol=0.05)
    assert np.abs(np.diff(d, axis=0)).max() < 0.1 * np.abs(d).max()


def test_a_place_out_of_reach_opens_no_contact():
    """The hand belongs far aside of where it touches, on a part that leads farther out there."""
    still, skin = hand_in_belly(-0.02)
    chest, wrist = (still.positions[0, PERSON.index(joint)] for joint in ("Chest", "LeftWrist"))
    out = normalised(wrist - chest)
    frames, aside = 60, normalised(np.cross(out, [0.0, 0.0, 1.0]))
    fields = no_anchors(frames, len(skin.limbs), 1)
    fields["anchor_offsets"][:, 0, 0], fields["anchor_rays"][:, 0, 0] = 0.1 * out + 0.2 * aside, out
    fields["anchor_weights"][:, 0, 0] = 1.0
    _, gaps = solved(skin, still[np.zeros(frames, int)], np.ones(frames), **fields)
    assert abs(gaps[30].min()) < 0.08 * 0.02 / skin.unit


def test_neither_the_way_of_time_nor_its_rate_nor_what_is_far_away_matters():
    motion, skin = swinging(121)
    back = motion[np.arange(121)[::-1]]
    d = solved(skin, motion)[0]
    np.testing.assert_allclose(solved(skin, back)[0][::-1], d, atol=0.01 * np.abs(d).max())
    motion, skin = swinging(241)
    fast, slow = solved(skin, motion, rate=2 * RATE)[0], solved(skin, motion[np.arange(0, 241, 2)])[0]
    np.testing.assert_allclose(slow, fast[::2], atol=0.02 * np.abs(fast).max())
    motion, skin = swinging(120)
    rest = np.zeros(round(2 * FADES * TAU * RATE), int)  # the hand is free in the first frame
    later = motion[np.concatenate([rest, np.arange(120), rest])]
    np.testing.assert_allclose(solved(skin, later)[0][len(rest) : -len(rest)], solved(skin, motion)[0], atol=2e-3)


def tied(frames, draw):
    """Anchors of all limbs, the second of which moves with the other arm."""
    shape = (*frames.anchor_weights.shape[:2], 2)
    rays = normalised(draw.normal(size=(*shape, 3)))
    shares = np.zeros((*shape, 2))
    shares[:, :2, 1] = [0.3, 0.7]
    return frames._replace(
        anchor_offsets=draw.normal(scale=0.1, size=rays.shape),
        anchor_rays=rays,
        anchor_weights=draw.uniform(0.5, 1.0, shape),
        anchor_shares=shares,
    )


@pytest.mark.parametrize(
    ("depth", "firmness", "free", "anchored", "above_floor"),
    [
        (0.03, 0.0, 1.0, False, NEVER),
        (-0.02, 0.7, 1.0, False, NEVER),
        (0.004, 0.0, 0.3, False, NEVER),
        (-0.05, 0.0, 1.0, True, NEVER),
        (-0.05, 0.0, 1.0, False, -0.005),
    ],
)
def test_slopes_are_those_of_the_energy(depth, firmness, free, anchored, above_floor):
    """Of a hand that is inside, of one that is drawn to a contact, of one that is held, of one that is anchored, and of
    one below the floor.
    """
    _, skin = hand_in_belly(depth)
    motion = standing({"LeftShoulder": [0, -1.2, 0], "LeftElbow": [0, -1.4, 0]})
    frames = Frames(*map(np.ascontiguousarray, frames_of(skin, motion, firmness, free)))
    frames = frames._replace(above_floor=np.full_like(frames.free, above_floor))
    count, draw = len(skin.limbs), np.random.default_rng(0)
    frames = tied(frames, draw) if anchored else frames
    zones, columns = np.arange(len(skin.balls.pairs)), np.append(np.arange(count), -1)
    displaced = skin.displaced._replace(limbs=skin.displaced.limbs % (count + 1))
    room, n = LimbWorkspace.of(skin.balls, zones, count), 6 * count

    def terms(w):
        energy, slope, bands = np.zeros(1), np.zeros((1, n)), np.zeros((1, n, 2 * n + 1))
        frame = w.reshape(1, count, 2, 3)
        write_terms(skin.balls, displaced, zones, columns, frames, frame, REACH, room, energy, slope, bands)
        return energy[0], slope[0], bands[0]

    w, step = draw.normal(scale=0.02, size=n), 1e-6
    _, slope, bands = terms(w)
    by_differences = [(terms(w + e)[0] - terms(w - e)[0]) / (2 * step) for e in step * np.eye(n)]
    assert np.abs(slope).max() > 0.01
    np.testing.assert_allclose(slope, by_differences, atol=1e-5 * np.abs(slope).max())
    whole = sum(np.diag(bands[: n - k, k], -k) for k in range(n))
    assert np.linalg.eigvalsh(whole + np.tril(whole, -1).T).min() > -1e-9 * bands.max()


def test_a_path_of_squares_is_solved_as_by_dense_equations():
    draw, count, n, tau = np.random.default_rng(0), 9, 6, 2.0
    h, aim = draw.uniform(0.5, 2.0, n), draw.normal(scale=0.05, size=(count, n))
    half = draw.normal(size=(count, n, n))
    K = half @ half.swapaxes(1, 2)

    def write(span, x, energy, slope, bands):
        off = x - aim[span]
        slope[:] = np.einsum("tij,tj->ti", K[span], off)
        energy[:] = 0.5 * (off * slope).sum(axis=1)
        bands[:] = 0.0
        for k in range(n):
            bands[:, : n - k, k] = np.diagonal(K[span], -k, 1, 2)

    path = _Path(np.zeros((count, n)), h, tau, write)
    path.settle(20)
    differences = [np.diff(np.eye(count), k, axis=0) for k in range(3)]
    M = sum(c * D.T @ D for c, D in zip((1.0, 2.0 * tau**2, tau**4), differences, strict=True))
    whole = np.kron(M, np.diag(h))
    for t in range(count):
        whole[n * t : n * (t + 1), n * t : n * (t + 1)] += K[t]
    right = np.einsum("tij,tj->ti", K, aim).ravel()
    np.testing.assert_allclose(path.x.ravel(), np.linalg.solve(whole, right), atol=1e-9)
