"""Hands lie on the same place of a body of another build."""

import numpy as np
import pytest
from bodies import CORPUS, SAMPLES, needs_corpus, sample, sample_run, sample_target
from scipy.spatial.transform import Rotation

from distretarget import Options, load_target, read_bvh, retarget
from distretarget.objectives.anchors import anchors
from distretarget.objectives.body_skin import Skins
from distretarget.objectives.contact_zones import APART, ContactZones
from distretarget.objectives.part_axes import IS_ROUND, PARTS, Axes, rays
from distretarget.objectives.skin import how_touching
from distretarget.skin.capsules import GROUP, SEGMENTS


def axes(seed=0):
    """Axes of parts, with lengths from 1 to 2."""
    rng = np.random.default_rng(seed)
    shape = (5, len(PARTS))
    turns = Rotation.from_quat(rng.normal(size=(5 * len(PARTS), 4))).as_matrix().reshape(*shape, 3, 3)
    return Axes(rng.normal(size=(*shape, 3)), turns, rng.uniform(1.0, 2.0, shape))


def points(hands=2, seed=1):
    """Points that touch, (frames, hands, parts, 3)."""
    return np.random.default_rng(seed).normal(size=(5, hands, len(PARTS), 3))


def test_touching_points_are_on_rays_that_move_with_the_body_and_do_not_depend_on_its_thickness():
    one, touching = axes(), points()
    turn, shift = Rotation.from_rotvec([0.3, -1.0, 2.0]), np.array([3.0, -2.0, 1.0])
    moved = Axes(
        turn.apply(one.starts.reshape(-1, 3)).reshape(one.starts.shape) + shift,
        one.directions @ turn.as_matrix().T,
        one.lengths,
    )
    places, out, _ = rays(one, one, touching)
    others, turned, _ = rays(one, moved, touching)
    np.testing.assert_allclose(turn.apply(places.reshape(-1, 3)).reshape(places.shape) + shift, others, atol=1e-12)
    np.testing.assert_allclose(turn.apply(out.reshape(-1, 3)).reshape(out.shape), turned, atol=1e-12)
    share = np.where(IS_ROUND, 0.0, 0.4)
    axis = one.starts + (share * one.lengths)[..., None] * one.directions[:, :, 0]
    for size in (0.1, 5.0):
        start, direction, heights = rays(one, one, (axis + size * one.directions[:, :, 2])[:, None])
        np.testing.assert_allclose(start[:, 0], axis, atol=1e-12)
        np.testing.assert_allclose(direction[:, 0], one.directions[:, :, 2], atol=1e-12)
        np.testing.assert_allclose(heights[:, 0], share + np.zeros((5, 1)), atol=1e-12)
    same, touching = axes(), points()
    places, out, heights = rays(same, same, touching)
    by = touching - places
    np.testing.assert_allclose(np.linalg.norm(by, axis=3)[..., None] * out, by, atol=1e-12)
    np.testing.assert_allclose(
        heights[..., None] * same.lengths[:, None, :, None],
        ((places - same.starts[:, None]) * same.directions[:, None, :, 0]).sum(axis=3, keepdims=True),
        atol=1e-12,
    )
    one, touching = axes(), points(hands=1)
    longer = one._replace(lengths=3.0 * one.lengths)
    low, high = (rays(one, other, touching)[0] - one.starts[:, None] for other in (one, longer))
    np.testing.assert_allclose(3.0 * low, high, atol=1e-12)


def skinned(target="child.json", clip="clap"):
    result = retarget(sample(clip), load_target(SAMPLES / target), Options(skin="average"))
    return result.skins.target, result.motion


def touching_all(skin, motion, limb, place, gap=0.0):
    """The fields of anchors on the same body where one limb touches a place in all frames, with a gap of capsules."""
    pairs = skin.balls.pairs
    zones = ContactZones.of(pairs[:, 0], GROUP[pairs[:, 1]])
    firm = (zones.limbs == SEGMENTS.index(limb)) & (zones.groups == GROUP[SEGMENTS.index(place)])
    firmness = np.tile(firm.astype(float), (len(motion), 1))
    gaps = np.where(pairs[:, 1] == SEGMENTS.index(place), gap, 0.05) + np.zeros((len(motion), 1))
    return anchors(motion, motion, Skins(skin, skin), zones, gaps, firmness)


def test_hands_on_hips_of_a_character_stay_on_the_same_character():
    hero = sample_target("hero")
    clip = retarget(sample("hands_on_hips")[60:120], hero).motion
    np.testing.assert_allclose(retarget(clip, hero).motion.positions, clip.positions, atol=1e-5)


@needs_corpus
def test_crossed_hands_stay_on_their_sides_on_the_same_character():
    hero = sample_target("hero")
    clip = retarget(read_bvh(CORPUS / "cmu_daz" / "14_30.bvh")[100:220], hero).motion
    off = np.linalg.norm(retarget(clip, hero).motion.positions - clip.positions, axis=2)
    assert off.max() < 0.005  # m


@pytest.mark.parametrize("clip", ["walk", "hands_on_hips"])
def test_what_sinks_nowhere_moves_as_it_did_on_the_same_character(clip):
    hero = sample_target("hero")
    motion = retarget(sample(clip), hero).motion
    np.testing.assert_allclose(retarget(motion, hero).motion.positions, motion.positions, atol=1e-5)  # m


@pytest.mark.parametrize(("limb", "place"), [("left hand", "pelvis"), ("right hand", "left upper arm")])
def test_on_the_same_body_what_touches_is_at_its_anchor(limb, place):
    skin, motion = skinned()
    fields = touching_all(skin, motion, limb, place)
    tied = fields["anchor_weights"] > 0
    assert tied.any()
    off, out = fields["anchor_offsets"][tied], fields["anchor_rays"][tied]
    np.testing.assert_allclose(np.linalg.norm(off, axis=1)[:, None] * out, off, atol=1e-9)


def test_parts_that_are_apart_have_no_anchor():
    skin, motion = skinned()
    assert touching_all(skin, motion, "left hand", "pelvis", gap=0.9 * APART)["anchor_weights"].any()
    assert not touching_all(skin, motion, "left hand", "pelvis", gap=APART)["anchor_weights"].any()


def test_places_of_the_other_arm_move_with_it():
    skin, motion = skinned()
    fields = touching_all(skin, motion, "right hand", "left upper arm")
    number = [*PARTS].index("left upper arm")
    right = next(n for n, limb in enumerate(skin.limbs) if SEGMENTS[skin.of_joint[limb.end]] == "right hand")
    assert (fields["anchor_weights"][:, right, number] > 0).all()
    middle, end = np.moveaxis(fields["anchor_shares"][:, right, number], 1, 0)
    assert ((middle >= 0) & (middle <= 1)).all()
    np.testing.assert_array_equal(end, 0)
    np.testing.assert_array_equal(fields["anchor_shares"][:, right, [*PARTS].index("trunk")], 0)


@pytest.mark.parametrize("clip", ["hands_on_hips"])
def test_hands_lie_on_hips_at_the_place_of_the_source_and_nearer_to_it_than_in_the_copy(clip):
    metrics = sample_run(clip).metrics
    assert metrics["result"]["touch_place"] < 0.75 * metrics["rotation_copy"]["touch_place"]


def test_a_place_on_a_head_is_its_direction_from_the_middle_wherever_the_joint_is():
    head, touching = [*PARTS].index("head"), points(hands=1)
    one, other = axes(), axes(seed=2)
    starts, out, _ = (each[:, 0, head] for each in rays(one, other, touching))
    np.testing.assert_allclose(starts, other.starts[:, head])
    of_source, of_target = (
        np.einsum("fij,fj->fi", each.directions[:, head], off)
        for each, off in ((one, touching[:, 0, head] - one.starts[:, head]), (other, out))
    )
    np.testing.assert_allclose(of_source / np.linalg.norm(of_source, axis=1)[:, None], of_target, atol=1e-12)
    skin, motion = skinned()
    ends = skin.unit * skin.posed(motion)[:, skin.capsules.segments == SEGMENTS.index("head")]
    np.testing.assert_allclose(skin.landmarks.axes(motion).starts[:, head], ends.mean(axis=(1, 2)), atol=1e-9)


def test_landmarks_of_both_skins_are_upright_where_the_body_stands():
    result = sample_run("hands_on_hips")
    for skin, motion in ((result.skins.source, result.source), (result.skins.target, result.motion)):
        directions = skin.landmarks.axes(motion).directions
        np.testing.assert_allclose(
            directions @ np.swapaxes(directions, 2, 3), np.broadcast_to(np.eye(3), directions.shape), atol=1e-9
        )
        trunk, head = (directions[:, [*PARTS].index(part)] for part in ("trunk", "head"))
        assert (trunk[:, 0, 1] > 0.9).all()
        assert ((trunk[:, 1] * head[:, 1]).sum(axis=1) > 0.7).all()  # both look to the front


def test_only_hands_and_forearms_touch():
    limbs = np.arange(len(SEGMENTS))
    zones = ContactZones.of(limbs, GROUP[np.full(len(limbs), SEGMENTS.index("belly"))])
    touching = how_touching(zones, np.zeros((2, len(limbs))))
    names = [SEGMENTS[limb] for limb, touches in zip(zones.limbs, touching[0], strict=True) if touches == 1]
    assert sorted(names) == ["left forearm", "left hand", "right forearm", "right hand"]
    assert set(touching.ravel()) == {0.0, 1.0}
