"""When joints that come near each other are in contact, and the stiffness and direction of what draws them."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import PERSON, clapping, matched, other_lengths, person, tree_of
from scipy.spatial.transform import Rotation

from distretarget import Body
from distretarget.baseline.rotation_copy import RootScale, rotation_copy
from distretarget.body.anatomy import Regions
from distretarget.body.limbs import arm_raise, in_front_or_behind
from distretarget.distances import distance_problem
from distretarget.ik.springs import Springs
from distretarget.objectives.activation import FADE, ContactSettings, SelfContact, activation
from distretarget.objectives.contact_pairs import LEAST_PATH, STIFFNESS, CandidatePairs, ContactSearch, candidate_pairs
from distretarget.objectives.contact_terms import LINEAR_RANGE, write_pair_spring
from distretarget.objectives.supports import Supports, no_supports
from distretarget.skin.limbs import Limb

REACH = ContactSettings().reach
SELF = SelfContact(lead=5.0, held=5, reach=REACH)
HANGING = 0.1  # D of a pair in a body with hanging arms


def one_shot(frames):
    return np.zeros(len(frames), np.intp)


def smootherstep(D):
    t = np.clip((REACH + FADE - D) / FADE, 0, 1)
    return 6 * t**5 - 15 * t**4 + 10 * t**3


@pytest.mark.parametrize("lead", [0, 1, 7])
def test_a_lasting_distance_has_a_full_activation_when_close_and_none_when_apart(lead):
    D = np.tile([0.0, REACH / 2, REACH, REACH + FADE / 2, REACH + FADE, 0.9], (40, 1))
    np.testing.assert_allclose(
        activation(D, one_shot(D), lead, REACH), np.tile([1, 1, 1, 0.5, 0, 0], (40, 1)), atol=1e-12
    )


@pytest.mark.parametrize("lead", [0, 1, 4, 18])
def test_an_activation_is_never_below_what_the_distance_asks_for_where_it_lasts_two_frames(lead):
    draw = np.random.default_rng(0)
    D = np.repeat(draw.uniform(0.05, 0.22, (100, 5)), 2, axis=0)
    assert np.all(activation(D, one_shot(D), lead, REACH) >= smootherstep(D) - 1e-12)


@pytest.mark.parametrize("lead", [6, 18])
def test_a_pair_that_comes_near_at_once_sets_in_smoothly_and_ahead(lead):
    D = np.where(np.abs(np.arange(200) - 100) <= 10, 0.05, 0.4)[:, None]
    f = activation(D, one_shot(D), lead, REACH)[:, 0]
    assert np.all(f[90:111] == pytest.approx(1.0))
    assert np.all(f[: 90 - 2 * lead] == 0)
    assert np.all(f[111 + 2 * lead :] == 0)
    assert np.all(np.diff(f)[:100] >= -1e-12)
    assert np.abs(np.diff(f)).max() < 1.5 / lead
    assert np.abs(np.diff(f, 2)).max() < 6 / lead**2
    np.testing.assert_allclose(f, f[::-1][np.arange(-1, 199)], atol=1e-12)


def of_self(D, raised, hanging=HANGING):
    return SELF.activation(D[:, None], np.array([hanging]), raised[:, None], one_shot(D), np.ones((len(D), 1)))[:, 0]


def test_a_hand_that_hangs_is_in_no_contact_and_one_that_comes_clearly_nearer_is():
    hangs = np.zeros(60)
    assert not of_self(np.full(60, HANGING), hangs).any()
    assert not of_self(np.full(60, 0.95 * HANGING), hangs).any()
    np.testing.assert_allclose(of_self(np.full(60, 0.5 * HANGING), hangs), 1.0)
    f = [of_self(np.full(60, share * HANGING), hangs)[30] for share in np.linspace(0.5, 1.0, 21)]
    assert np.all(np.diff(f) <= 0)


def test_a_hand_that_stays_near_on_a_bent_arm_is_in_contact_and_one_that_passes_is_not():
    bent, stays = np.ones(120), np.full(120, HANGING)
    np.testing.assert_allclose(of_self(stays, bent), 1.0)
    np.testing.assert_allclose(of_self(stays, 0.5 * bent), 0.5)
    passes = HANGING + 0.01 * np.abs(np.arange(120) - 60)
    assert not of_self(passes, bent).any()


@pytest.mark.parametrize("raised", [0.0, 1.0])
def test_pairs_beyond_their_limit_are_in_no_contact(raised):
    limit = SELF.apart(np.array([HANGING]), np.array([raised > 0]))[0]
    assert not of_self(np.full(50, limit), np.full(50, raised)).any()
    assert of_self(np.full(50, 0.9 * limit), np.full(50, raised)).any()


def test_arms_hang_by_gravity_or_along_the_trunk_and_elbows_count():
    """An arm along X: shoulder, elbow, wrist, and the hip below the shoulder."""
    arm, up = Limb(0, 1, 2, True), np.array([0.0, 1.0, 0.0])
    straight = np.array([[0, 0, 0], [0, -1, 0], [0, -2, 0], [0, -2, 0]], float)

    def of(shoulder, elbow, whole=0.0):
        x = straight.copy()
        x[2] = x[1] + Rotation.from_euler("X", elbow, degrees=True).apply(x[2] - x[1])
        x[1:3] = Rotation.from_euler("X", shoulder, degrees=True).apply(x[1:3])
        return arm_raise(Rotation.from_euler("X", whole, degrees=True).apply(x)[None], arm, [3], up)[0]

    assert of(20, 30) == 0.0
    assert of(50, 60) == pytest.approx(1.0)
    assert 0 < of(0, 80) < 1
    assert of(90, 0) > of(70, 0)
    assert of(0, 0, whole=90) == 0.0  # lies with its arms along the trunk
    assert of(-90, 0, whole=90) == 0.0  # bends forwards, and its arms hang


@pytest.mark.parametrize(
    ("angle", "expected"), [(0, 0.0), (30, 0.0), (45, 0.5), (60, 1.0), (90, 1.0), (150, 0.0), (-90, 1.0)]
)
def test_a_hanging_hand_is_put_in_front_of_the_trunk_or_behind_it(angle, expected):
    """Shoulders, hips and a hand at an angle from the left, round a trunk that is bent and turned."""
    hand = np.array([0.2 * np.cos(np.radians(angle)), -0.1, 0.2 * np.sin(np.radians(angle))])
    x = np.array([[0.2, 0.5, 0], [-0.2, 0.5, 0], [0.1, 0, 0], [-0.1, 0, 0], hand])
    x = Rotation.from_euler("XYZ", [40, 70, 20], degrees=True).apply(x) + 3.0
    assert in_front_or_behind(x[None], [4], [0, 1], [2, 3])[0] == pytest.approx(expected, abs=1e-9)


def test_hanging_arms_are_as_long_as_the_arms_and_below_the_shoulders():
    body = Body.of(person())
    assert len(body.arms) == 2
    for arm in body.arms:
        hand = body.hanging[arm.end] - body.hanging[arm.top]
        reach = body.skeleton.paths_from(arm.top)[arm.end]
        np.testing.assert_allclose(hand, -reach * body.reference.axes[:, 1], atol=1e-9)
    others = np.setdiff1d(
        np.arange(len(body.skeleton)), [j for arm in body.arms for j in body.skeleton.subtree(arm.top)]
    )
    np.testing.assert_array_equal(body.hanging[others], body.reference.positions[others])


TARGET = other_lengths(PERSON)
MATCHING = matched(PERSON, TARGET)
PROBLEM = distance_problem(PERSON, TARGET, MATCHING.drivers)
UNIT = 1.7
SETTINGS = ContactSettings()
BODY = MATCHING.target
FAR = np.outer(np.arange(len(PERSON)), [1e9, 0.0, 0.0])  # a body that is near itself nowhere
PAIRS = candidate_pairs(PROBLEM, BODY.regions, BODY.legs, UNIT, FAR, np.ones(len(PROBLEM), bool))
SIZES = PERSON.path_sizes(np.arange(len(PERSON)))
FARTHEST = SETTINGS.reach


def copied(source):
    return rotation_copy(matched(source, TARGET), RootScale.even(1.0)).positions


def springs_of(source, block, lead):
    copy = copied(source) / UNIT
    points = source.positions[:, PROBLEM.sources], copy[:, PROBLEM.targets]
    return written(near(PAIRS, points, no_supports(len(source))[block], block, replace(SETTINGS, blend=lead)))


def resting(weights: np.ndarray, *regions: int, feet: int = 0) -> Supports:
    """Supports of these weights, (frames, supports), in regions, the first of them of feet."""
    return replace(no_supports(len(weights)), regions=np.array(regions), feet=feet, weights=weights)


def near(pairs, points, held, block, settings=SETTINGS):
    """The near pairs of points without cuts and without arms; a frame takes a second, so that a lead is in frames."""
    source, copy = points
    contacts = ContactSearch(
        pairs=pairs,
        source=source,
        copy=copy,
        shots=one_shot(source),
        raised=np.zeros(source.shape[:2]),
        frame_time=1.0,
        settings=settings,
        regions=len(BODY.regions.names),
    )
    return contacts.near(block, held)


def written(near):
    """The springs of near pairs, with the frames in front."""
    rest, A = np.empty((*near.w.shape, 3)), np.empty((*near.w.shape, 3, 3))
    for frame, pair in np.ndindex(near.w.shape):
        write_pair_spring(near, frame, pair, rest[frame, pair], A[frame, pair])
    return Springs(near.a, near.b, rest, A)


def by_pair(springs):
    """Per pair of joints: rest and stiffness, with the frames in front."""
    return {
        (int(a), int(b)): (springs.rest[:, s], springs.A[:, s])
        for s, (a, b) in enumerate(zip(springs.a, springs.b, strict=True))
    }


def every_joint_a_region(joints):
    return Regions(tuple(map(str, range(joints))), np.arange(joints), np.eye(joints, dtype=bool))


def test_all_pairs_of_regions_apart_and_far_along_the_tree_are_looked_at_and_no_other():
    expected = {
        (u, v)
        for u in range(len(PERSON))
        for v in range(u + 1, len(PERSON))
        if SIZES[u, v] >= LEAST_PATH and not BODY.regions.neighbours[BODY.regions.of_joint[u], BODY.regions.of_joint[v]]
    }
    found = set(zip(PROBLEM.targets[PAIRS.u].tolist(), PROBLEM.targets[PAIRS.v].tolist(), strict=True))
    assert found == expected
    ankles = PERSON.index("LeftAnkle"), PERSON.index("RightAnkle")
    assert tuple(sorted(ankles)) in found
    assert tuple(sorted((PERSON.index("LeftKnee"), PERSON.index("LeftToe")))) not in found


def test_joints_that_coincide_by_their_bones_are_no_pair():
    chain = tree_of(np.outer(np.arange(6) == 5, [0, 1, 0]))
    longer = chain.with_offsets(np.tile([0, 1.0, 0], (6, 1)))
    problem = distance_problem(chain, longer, np.arange(6))
    pairs = candidate_pairs(problem, every_joint_a_region(6), None, 1.0, FAR[:6], np.ones(6, bool))
    assert set(zip(pairs.u.tolist(), pairs.v.tolist(), strict=True)) == {(0, 5), (1, 5)}


@pytest.mark.parametrize("lead", [0.0, 1.0, 9.0])
@pytest.mark.parametrize(
    "together",
    [np.sin(np.linspace(0, 9, 150)) ** 2, np.random.default_rng(0).uniform(0, 1, 150)],
    ids=["claps", "spikes"],
)
def test_springs_of_a_block_are_those_of_the_whole_clip(together, lead):
    source = clapping(together)
    whole = by_pair(springs_of(source, slice(0, 150), lead))
    assert max(A.max() for _, A in whole.values()) > 1
    for block in (slice(0, 40), slice(40, 90), slice(77, 78), slice(100, 150)):
        part = by_pair(springs_of(source, block, lead))
        assert set(part) <= set(whole)
        for pair, expected in whole.items():
            if pair in part:
                for found, values in zip(part[pair], expected, strict=True):
                    np.testing.assert_allclose(found, values[block], rtol=1e-9, atol=1e-12)
            else:
                assert np.abs(expected[1][block]).max() == 0.0


def test_a_kept_pair_belongs_at_its_scaled_distance_in_the_direction_of_the_source():
    source = clapping(np.ones(5))
    springs = springs_of(source, slice(0, 5), 2.0)
    left, right = PERSON.index("LeftWrist"), PERSON.index("RightWrist")
    rest, A = by_pair(springs)[right, left]
    d = source.positions[:, right] - source.positions[:, left]
    D = np.linalg.norm(d, axis=1) / PERSON.paths_from(left)[right]
    assert D.max() < FARTHEST
    np.testing.assert_allclose(np.linalg.norm(rest, axis=1), D * TARGET.paths_from(left)[right] / UNIT)
    np.testing.assert_allclose(rest / np.linalg.norm(rest, axis=1)[:, None], d / np.linalg.norm(d, axis=1)[:, None])
    stiffness, directions = np.linalg.eigh(A)
    along = np.abs(np.einsum("fi,fi->f", directions[..., -1], d)) / np.linalg.norm(d, axis=1)
    np.testing.assert_allclose(along, 1.0)
    assert np.all(stiffness[:, 0] > 0.9 * stiffness[:, -1])


def test_the_copys_place_passes_smoothly_into_the_kept_place():
    source = clapping(np.sin(np.linspace(0, np.pi, 161)) ** 2)
    springs = springs_of(source, slice(0, 161), 0.0)
    left, right = PERSON.index("LeftWrist"), PERSON.index("RightWrist")
    rest, A = by_pair(springs)[right, left]
    copy = copied(source) / UNIT
    d_copy = copy[:, right] - copy[:, left]
    off = ~A.any(axis=(1, 2))
    assert off.any()
    assert not off.all()
    np.testing.assert_allclose(rest[off], d_copy[off], atol=1e-12)
    assert np.abs(np.diff(rest, axis=0)).max() < 0.1
    assert np.abs(rest - d_copy).max() > 0.05


def test_nearer_pairs_are_stiffer_and_in_more_directions():
    source = clapping(np.linspace(0.85, 1.0, 30))
    left, right = PERSON.index("LeftWrist"), PERSON.index("RightWrist")
    _, A = by_pair(springs_of(source, slice(0, 30), 60.0))[right, left]
    stiffness = np.linalg.eigvalsh(A)
    assert np.all(np.diff(stiffness[:, -1]) > 0)
    assert np.all(np.diff(stiffness[:, 0] / stiffness[:, -1]) > 0)


def lone_and_cluster(count):
    """Weight of every pair where `count` points stand near `count` others, all at half the reach of a contact."""
    points = 2 * count
    u, v = (ends.ravel() for ends in np.meshgrid(np.arange(count), np.arange(count, points), indexing="ij"))
    tau = np.full(len(u), 2 / FARTHEST)
    far = np.full(len(u), np.inf)
    none = np.zeros((len(u), 2), np.intp)
    pairs = CandidatePairs(u, v, u, v, tau, np.ones(len(u)), far, none, np.zeros(len(u), bool))
    x = np.tile(np.where(np.arange(points) < count, 0.0, 1.0)[:, None] * [1.0, 0, 0], (3, 1, 1))
    springs = written(near(pairs, (x, x), no_supports(3), slice(0, 3), replace(SETTINGS, blend=0.0)))
    return np.linalg.eigvalsh(springs.A[1])[:, -1]


def test_a_point_near_a_cluster_is_pulled_about_as_much_as_one_near_a_single_point():
    lone = lone_and_cluster(1).sum()
    assert STIFFNESS / 3 < lone < STIFFNESS
    for count in (2, 4, 8):
        weights = lone_and_cluster(count)
        assert len(weights) == count**2
        assert lone < weights.sum() / count < 2 * lone


def test_the_pull_of_a_pair_is_bounded_and_within_reach_it_grows_with_the_change_that_it_asks_for():
    """Two points at half the reach; in the rotation copy they are farther apart, by more and more."""
    asked = np.array([0.0, 0.001, 0.002, 0.3, 0.6, 1.2])
    one, far = np.ones(1), np.full(1, np.inf)
    u, v, regions = np.array([0]), np.array([1]), np.array([[0, 1]])
    pairs = CandidatePairs(u, v, u, v, 2 * one / FARTHEST, one, far, regions, one == 0)
    source = np.tile([[0.0, 0, 0], [1.0, 0, 0]], (len(asked), 1, 1))
    copy = np.array(source)
    copy[:, 1, 0] += asked
    springs = written(near(pairs, (source, copy), no_supports(len(asked)), slice(0, len(asked)), SETTINGS))
    np.testing.assert_allclose(springs.rest[:, 0], [[-1.0, 0, 0]] * len(asked), atol=1e-9)
    pull = springs.A[:, 0, 0, 0] * asked
    assert pull[2] == pytest.approx(2 * pull[1], rel=1e-3)
    assert pull[-1] == pytest.approx(pull[-2], rel=1e-2)
    assert pull[-1] == pytest.approx(springs.A[0, 0, 0, 0] * LINEAR_RANGE, rel=1e-2)


def test_feet_are_no_pair_while_one_of_them_rests():
    source = clapping(np.ones(4))
    copy = copied(source) / UNIT
    points = source.positions[:, PROBLEM.sources], copy[:, PROBLEM.targets]
    settings = replace(SETTINGS, reach=0.5, blend=0.0)
    both = {"LeftAnkle", "LeftToe", "LeftToe_End"}, {"RightAnkle", "RightToe", "RightToe_End"}
    standing = resting(np.array([[0.0], [0.5], [1.0], [0.0]]), BODY.regions.names.index("left foot"), feet=1)
    pairs = near(PAIRS, points, standing, slice(0, 4), settings)
    feet = [
        {PERSON.names[a], PERSON.names[b]} & both[0] and {PERSON.names[a], PERSON.names[b]} & both[1]
        for a, b in zip(pairs.a, pairs.b, strict=True)
    ]
    feet = np.array([bool(each) for each in feet])
    assert feet.any()
    assert np.all(pairs.w[2, feet] == 0)
    assert np.all((pairs.w[1, feet] > 0) & (pairs.w[1, feet] < pairs.w[0, feet]))
    assert np.all(pairs.w[2, ~feet] > 0)


def test_hands_that_both_rest_are_no_pair():
    source = clapping(np.ones(3))
    points = source.positions[:, PROBLEM.sources], copied(source)[:, PROBLEM.targets] / UNIT
    hands = [BODY.regions.names.index(f"{side} hand") for side in ("left", "right")]
    held = resting(np.array([[0.0, 1.0], [0.5, 1.0], [1.0, 1.0]]), *hands)
    pairs = near(PAIRS, points, held, slice(0, 3), replace(SETTINGS, blend=0.0))
    of_hands = np.all(np.isin(BODY.regions.of_joint[np.stack([pairs.a, pairs.b])], hands), axis=0)
    assert of_hands.any()
    np.testing.assert_allclose(pairs.f[:, of_hands], pairs.f[0, of_hands] * [[1.0], [0.5], [0.0]])
