"""Hands lie on the same place of a body of another build."""

from functools import cache

import numpy as np
import pytest
from bodies import SAMPLES
from scipy.spatial.transform import Rotation

from distretarget import load_target, read_bvh, retarget
from distretarget.objectives.part_axes import PARTS, Axes, rays
from distretarget.objectives.skin import how_touching
from distretarget.objectives.spots import Spots
from distretarget.skin.capsules import PLACE, SEGMENTS

HERO = SAMPLES.parent / "sample_characters" / "hero.glb"


@cache
def run(clip):
    return retarget(read_bvh(SAMPLES / f"{clip}.bvh"), load_target(HERO))


def axes(frames=5, seed=0, scale=1.0):
    """Axes of parts, with lengths from 1 to 2."""
    rng = np.random.default_rng(seed)
    shape = (frames, len(PARTS))
    turns = Rotation.from_quat(rng.normal(size=(frames * len(PARTS), 4))).as_matrix().reshape(*shape, 3, 3)
    return Axes(rng.normal(size=(*shape, 3)), turns, scale * rng.uniform(1.0, 2.0, shape))


def off(hands, places, out):
    """How far hands, (frames, hands, 3), are off rays, (frames, hands, parts)."""
    by = hands[:, :, None] - places
    return np.linalg.norm(by - (by * out).sum(axis=3, keepdims=True) * out, axis=3)


def test_on_the_same_body_hands_are_on_their_rays():
    hands = np.random.default_rng(1).normal(size=(5, 2, 3))
    same = axes()
    assert off(hands, *rays(same, same, hands)).max() < 1e-12


def test_rays_move_with_the_body_and_do_not_depend_on_its_thickness():
    one, hands = axes(), np.random.default_rng(1).normal(size=(5, 2, 3))
    turn, shift = Rotation.from_rotvec([0.3, -1.0, 2.0]), np.array([3.0, -2.0, 1.0])
    moved = Axes(
        turn.apply(one.starts.reshape(-1, 3)).reshape(one.starts.shape) + shift,
        one.directions @ turn.as_matrix().T,
        one.lengths,
    )
    places, out = rays(one, one, hands)
    others, turned = rays(one, moved, hands)
    np.testing.assert_allclose(turn.apply(places.reshape(-1, 3)).reshape(places.shape) + shift, others, atol=1e-12)
    np.testing.assert_allclose(turn.apply(out.reshape(-1, 3)).reshape(out.shape), turned, atol=1e-12)
    part = 0
    axis = one.starts[:, part] + 0.4 * one.lengths[:, part, None] * one.directions[:, part, 0]
    near, far = (axis + size * one.directions[:, part, 2] for size in (0.1, 5.0))
    for some in (near, far):
        start, direction = (each[:, 0, part] for each in rays(one, one, some[:, None]))
        np.testing.assert_allclose(start, axis, atol=1e-12)
        np.testing.assert_allclose(direction, one.directions[:, part, 2], atol=1e-12)


def test_heights_are_in_lengths_of_the_axis():
    one, hands = axes(), np.random.default_rng(1).normal(size=(5, 1, 3))
    longer = one._replace(lengths=3.0 * one.lengths)
    low, high = (rays(one, other, hands)[0] - one.starts[:, None] for other in (one, longer))
    np.testing.assert_allclose(3.0 * low, high, atol=1e-12)


@pytest.mark.parametrize("clip", ["hands_on_hips"])
def test_hands_lie_on_hips_at_the_place_of_the_source_and_nearer_to_it_than_in_the_copy(clip):
    metrics = run(clip).metrics
    assert metrics["result"]["touch_place"] < 0.7 * metrics["rotation_copy"]["touch_place"]


def test_landmarks_of_both_skins_are_upright_where_the_body_stands():
    result = run("hands_on_hips")
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
    spots = Spots.of(limbs, PLACE[np.full(len(limbs), SEGMENTS.index("belly"))])
    touching = how_touching(spots, np.zeros((2, len(limbs))))
    names = [SEGMENTS[limb] for limb, touches in zip(spots.limbs, touching[0], strict=True) if touches == 1]
    assert sorted(names) == ["left forearm", "left hand", "right forearm", "right hand"]
    assert set(touching.ravel()) == {0.0, 1.0}
