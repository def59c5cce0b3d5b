"""Scenes of thick bodies: limbs leave the other performers, and hands lie on those whom they touch."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bodies import SAMPLES, moved, sample, sample_target
from scipy.spatial.transform import Rotation

from distretarget import Options, retarget, retarget_scene
from distretarget.body.build import Build, Builds, average_build
from distretarget.measure.gaps import measure_overlap, measure_skin_contacts
from distretarget.measure.skin import find_skin
from distretarget.measure.skin_touches import FARTHEST
from distretarget.objectives.part_axes import rays
from distretarget.objectives.skin import limb_displacements
from distretarget.objectives.supports import BLEND
from distretarget.scene import skin as scene_skin
from distretarget.scene.scene_file import load_scene
from distretarget.scene.skin import COUNT, DRAWN_WITHIN, Bodies, _middle
from distretarget.skin.capsules import SEGMENTS

TOUCH = 0.005  # gaps of less in the source touch [body units]


@cache
def sources(name):
    motions, _ = load_scene(SAMPLES / "scenes" / name / "scene.json").read()
    return motions


@cache
def scene(name):
    """The performers of a sample scene on a child and on a body as long as the source's, both as thick as adults."""
    body = sources(name)[0].rigid_skeleton
    targets = [sample_target("child").for_source(body), body]
    return retarget_scene(sources(name), targets, skin="average").results


def hand_gaps(performers, kind, motions):
    """(frames,), the least gap of a hand of one performer and the other's skin, in source or target [body units]."""
    bodies = Bodies([getattr(one.skins, kind) for one in performers])
    pairs, hands = bodies.balls.pairs, [number for number, each in enumerate(SEGMENTS) if "hand" in each]
    across = np.not_equal(*(pairs // COUNT).T) & np.isin(pairs % COUNT, hands).any(axis=1)
    return bodies.gaps(motions)[:, across].min(axis=1)


@cache
def gaps(name):
    """The gaps of hands in source and result."""
    before, after = [one.matching.source_motion for one in scene(name)], [one.motion for one in scene(name)]
    return hand_gaps(scene(name), "source", before), hand_gaps(scene(name), "target", after)


@pytest.mark.parametrize("name", ["handshake", "high_five", "waltz", "push"])
def test_hands_do_not_sink_into_others(name):
    assert gaps(name)[1].min() > -2 * TOUCH  # flesh gives way by one


@pytest.mark.parametrize("name", ["handshake", "high_five", "waltz"])
def test_hands_lie_on_those_whom_they_touch(name):
    before, after = gaps(name)
    touches = before < TOUCH
    assert touches.sum() > 20
    assert np.median(after[touches]) < 2 * TOUCH


def places_on_trunk(kind, motions, holder, held):
    """(hands, frames, 2), the angles and the heights of the middles of both hands about the other's trunk [rad, 1]."""
    skins = [getattr(one.skins, kind) for one in scene("lift")]
    axes, found = skins[held].landmarks.axes(motions[held]), []
    for hand in ("left hand", "right hand"):
        middles = _middle(skins[holder], motions[holder], SEGMENTS.index(hand))
        off = np.einsum("fij,fj->fi", axes.directions[:, 0], middles - axes.starts[:, 0])
        found.append(np.stack([np.arctan2(off[:, 2], off[:, 1]), off[:, 0] / axes.lengths[:, 0]], axis=1))
    return np.array(found)


def test_hands_lie_on_the_same_place_of_those_whom_they_lift():
    before, after = [one.source for one in scene("lift")], [one.motion for one in scene("lift")]
    of_source, of_result = (places_on_trunk(*each, 0, 1) for each in (("source", before), ("target", after)))
    off = np.abs(of_result - of_source)[:, hand_gaps(scene("lift"), "source", before) < TOUCH]
    assert np.degrees(off[..., 0]).mean() < 10.0
    assert off[..., 1].mean() < 0.15


def test_hands_on_the_wrong_side_of_another_move_round_to_the_sources(monkeypatch):
    def noted(*given):
        calls.append(given)
        return move(*given)

    def opposite(*given):
        starts, out, heights = rays(*given)
        return starts, -out, heights

    calls, move = [], scene_skin._hands_on_others
    monkeypatch.setattr(scene_skin, "_hands_on_others", noted)
    scene.__wrapped__("lift")
    posed = calls[0][3]
    kept, anchors = move(*calls[0])
    for before, after in zip(posed, kept, strict=True):
        np.testing.assert_allclose(after.positions, before.positions, atol=0.5)  # cm

    monkeypatch.setattr(scene_skin, "rays", opposite)
    turned, found = move(*calls[0])
    touch = found["anchor_weights"] > 0.9
    assert touch.sum() > 100
    assert ((found["anchor_offsets"] * found["anchor_rays"]).sum(axis=3)[touch] > 0.0).mean() > 0.9
    skins, unit = calls[0][2].skins, calls[0][2].unit
    wrists = [[limb.end for limb in skin.limbs] for skin in skins]
    x, y = (
        np.concatenate([m.positions[:, at] for m, at in zip(each, wrists, strict=True)], axis=1)
        for each in (kept, turned)
    )
    moves = found["anchor_offsets"] - anchors["anchor_offsets"]
    np.testing.assert_allclose(moves[touch], ((y - x) / unit)[:, :, None].repeat(touch.shape[2], 2)[touch], atol=0.02)


def test_what_hands_touch_sets_in_over_time(monkeypatch):
    def solved(balls, displaced, zones, frames, *rest):
        steps.append(np.abs(np.diff(frames.firmness, axis=0)).max() / rest[2])
        return limb_displacements(balls, displaced, zones, frames, *rest)

    steps = []
    monkeypatch.setattr(scene_skin, "limb_displacements", solved)
    scene.__wrapped__("high_five")
    assert 0.0 < steps[0] < 1.0 / BLEND  # [1/s]


def test_who_claps_beside_another_claps_as_alone():
    """Hands near another performer, but not on it, still touch their own body."""
    one, hero = sample("clap")[:180:2], sample_target("hero")
    height, width = np.ptp(one.positions[0, :, 1]), np.ptp(one.positions[..., 0])
    other = moved(one, Rotation.identity(), shift=(width + 0.08 * height, 0.0, 0.0))
    alone = retarget(one, hero).metrics["result"]["skin_gap"]
    for performer in retarget_scene([one, other], [hero] * 2).results:
        assert performer.metrics["result"]["skin_gap"] == pytest.approx(alone, abs=0.05)


def test_thick_performers_who_never_meet_move_as_alone():
    one, body = sources("push")[0], sources("push")[0].rigid_skeleton
    other = moved(one, Rotation.identity(), shift=(1000.0, 0.0, 0.0))
    apart = retarget_scene([one, other], [body] * 2, skin="average")
    assert (apart.sweeps, apart.gaps[0, 1]) == (1, None)
    alone = retarget(one, body, Options(skin="average")).motion
    np.testing.assert_allclose(apart.results[0].motion.positions, alone.positions, atol=1e-6)
    body = sources("handshake")[0].rigid_skeleton
    fat = Build({part: np.multiply(ends, [1.0, 1.0, 1.0, 1.5]) for part, ends in average_build("adult").parts.items()})
    given = {"skin": ["auto", "average"], "builds": [Builds(target=fat), Builds()]}
    one, other = (r.skins.target for r in retarget_scene(sources("handshake"), [body] * 2, **given).results)
    np.testing.assert_allclose(one.capsules.radii, 1.5 * other.capsules.radii)


def test_a_stick_metric_beside_a_thick_body_is_an_average_build_to_it():
    body = sources("handshake")[0].rigid_skeleton
    thick = retarget_scene(sources("handshake"), [body] * 2, skin="average").results
    beside = retarget_scene(sources("handshake"), [body] * 2, skin=["auto", "average"]).results
    assert [one.skins is None for one in beside] == [True, False]
    before = hand_gaps(thick, "source", [one.matching.source_motion for one in thick])
    after = hand_gaps(thick, "target", [one.motion for one in beside])
    assert after.min() > -2 * TOUCH
    assert np.median(after[before < TOUCH]) < 2 * TOUCH


def test_nobody_is_thick_to_one_who_is_to_have_no_thickness():
    body, motions = sources("high_five")[0].rigid_skeleton, sources("high_five")
    beside = retarget_scene(motions, [body] * 2, skin=["none", "average"]).results[0]
    alone = retarget_scene(motions, [body] * 2, skin="none").results[0]
    np.testing.assert_array_equal(beside.motion.positions, alone.motion.positions)


def test_bodies_keep_their_own_gaps_among_others():
    skins = [one.skins.target for one in scene("push")]
    motions = [one.motion[:5] for one in scene("push")]
    both = Bodies(skins)
    for number, (skin, motion) in enumerate(zip(skins, motions, strict=True)):
        alone = Bodies([skin])
        own = (both.balls.pairs // COUNT == number).all(axis=1)
        near = np.minimum(both.gaps(motions)[:, own] * both.unit, 0.9 * DRAWN_WITHIN * min(both.unit, alone.unit))
        expected = np.minimum(alone.gaps([motion]) * alone.unit, 0.9 * DRAWN_WITHIN * min(both.unit, alone.unit))
        np.testing.assert_allclose(near, expected, atol=1e-6)


@cache
def walking_hero():
    result = retarget(sample("walk")[:3], sample_target("hero"))
    return result.motion, find_skin(result.matching.target, result.skins.target.capsules, result.mesh)


def two_heroes(aside):
    """The motions and skins of a hero and the same one so far aside [heights]."""
    motion, skin = walking_hero()
    path = motion.root_positions + np.array([aside * skin.height, 0.0, 0.0])
    return [motion, replace(motion, root_positions=path)], [skin, skin]


def test_how_deep_performers_are_in_each_other_has_known_answers():
    def overlap(aside, order=(0, 1)):
        motions, skins = two_heroes(aside)
        return measure_overlap([motions[k] for k in order], skins)

    assert overlap(1.0).depth == 0.0
    assert overlap(0.2).depth > 2.0
    assert overlap(0.2).depth > overlap(0.4).depth
    one, other = overlap(0.2), overlap(0.2, (1, 0))
    np.testing.assert_allclose(one.depth, other.depth, rtol=1e-6)
    assert one.parts == other.parts[::-1]


def test_performers_who_overlap_in_the_source_may_just_touch():
    def errors(aside, of_source=0.2):
        (source, _), (motions, skins) = two_heroes(of_source), two_heroes(aside)
        return np.array([touch.error for touch in measure_skin_contacts(source, motions, skins, skins).touches])

    assert errors(0.2).max() < 1e-9
    assert np.median(errors(0.202)) == 0.0
    assert errors(0.202).max() < 0.3
    assert errors(0.19).max() > 0.3
    assert errors(0.5).min() > 5.0
    assert errors(2.0) == pytest.approx(FARTHEST, rel=0.1)
