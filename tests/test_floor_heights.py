"""How low joints may be: the floor where the source's lowest joint is, and where it was just before."""

import json
from dataclasses import replace

import numpy as np
import pytest
from bodies import HERO, SAMPLES

from distretarget import load_target, read_bvh, retarget
from distretarget.baseline.rotation_copy import RootScale
from distretarget.body.resting import REST_HEIGHT
from distretarget.objectives.floor import STIFFNESS, Flesh, find_flesh, find_floor_springs, rise_of_flesh
from distretarget.objectives.foot_lock import find_foot_lock
from distretarget.pipeline.performer import Performer, Transfer, match_performer
from distretarget.skin.capsules import SEGMENTS

CRAWL = read_bvh(SAMPLES / "supports" / "crawl.bvh")
UP = 30.0  # [cm]
UPWARDS = np.array([0.0, 1.0, 0.0])


def floor_of(source, target):
    """The clip, and the floor while something rests in all frames."""
    match = match_performer(Transfer(source, load_target(SAMPLES / target)))
    clip = Performer.of(match, RootScale.even(1.0)).clip
    return clip, find_floor_springs(clip, np.ones((len(source), 1)))


def on_floor_of(source, target):
    """The clip on a target of legs of any length, and what both rest on."""
    match = match_performer(Transfer(source, load_target(target)))
    own, leg = match.matching.leg_lengths
    return Performer.of(match, RootScale.even(leg / own)).clip, match.undersides


def lifted(frames):
    """The crawl, higher in some frames."""
    path = np.array(CRAWL.root_positions)
    path[frames, 1] += UP
    return replace(CRAWL, root_positions=path)


def test_a_joint_that_nothing_drives_may_be_as_low_as_the_lowest_joint_of_the_source():
    clip, floor = floor_of(CRAWL, "rigs/mixamo_t.json")
    followers = np.isin(floor.joints, clip.undriven_joints)
    lowest = CRAWL.positions[..., 1].min()
    heights = floor.heights * clip.unit
    assert followers.sum() > 30
    np.testing.assert_allclose(heights[:, followers].min(), lowest, atol=1e-9)
    assert (heights[:, followers] <= CRAWL.positions[..., 1].min(axis=1)[:, None] + 1e-9).all()


@pytest.mark.parametrize("frames", [slice(100, 101), slice(100, 103)])
def test_the_floor_does_not_jump_with_a_body_that_does(frames):
    _, floor = floor_of(CRAWL, "child.json")
    clip, jumping = floor_of(lifted(frames), "child.json")
    rise = (jumping.heights - floor.heights[:, np.isin(floor.joints, jumping.joints)]) * clip.unit
    assert rise.max() < REST_HEIGHT * clip.leg_lengths[1] + 1e-9


def test_parts_of_a_region_share_the_stiffness_of_the_floor():
    """A hand with twenty finger joints is pushed up no harder than one without, and no firmer than the body rests; but
    each knuckle of its palm as hard as all of them, since the palm may lie on one.
    """
    clip, _ = floor_of(CRAWL, "rigs/unreal_t.json")
    weights = np.linspace(0.0, 1.0, len(clip))
    floor = find_floor_springs(clip, np.stack([weights, 0.5 * weights], axis=1))
    regions, parts = clip.regions.of_joint[floor.joints], clip.parts[clip.skeleton.parents[floor.joints]]
    loose = np.isin(parts, clip.loose_parts)
    for region in np.unique(regions):
        own = (regions == region) & ~loose
        firmest = [floor.stiffness[:, own & (parts == part)].max(axis=1) for part in np.unique(parts[own])]
        np.testing.assert_allclose(np.sum(firmest, axis=0), STIFFNESS * weights)
        fingers = floor.stiffness[:, (regions == region) & loose]
        assert (fingers.sum(axis=1) <= STIFFNESS * weights).all()
    palm = next(part for part in parts if (parts == part).sum() >= 5 and part not in clip.loose_parts)
    np.testing.assert_allclose(floor.stiffness[:, parts == palm].sum(axis=1), (parts == palm).sum() * 250.0 * weights)


def test_joints_are_near_the_floor_where_the_root_takes_them():
    """The root's path counts, not the rotation copy's own: hips that rise take the hands away from the floor."""
    clip, floor = floor_of(CRAWL, "child.json")
    weights, leg = np.ones((len(clip), 1)), clip.leg_lengths[1]
    assert 0 < len(floor.joints) < len(clip.limb_joints)
    assert len(find_floor_springs(clip.raised(np.tile(10 * leg * clip.up, (len(clip), 1))), weights).joints) == 0
    sunk = find_floor_springs(clip.raised(np.tile(-10 * leg * clip.up, (len(clip), 1))), weights)
    assert set(clip.limb_joints) <= set(sunk.joints)


@pytest.mark.parametrize("rig", ["mixamo_t", "unreal_t"])
def test_the_fingers_of_a_push_up_sink_by_less_than_a_four_hundredth_of_a_leg(rig):
    """Nothing drives them, and the hand above them is held: only the floor's stiffness keeps them up."""
    result = retarget(read_bvh(SAMPLES / "supports" / "push_up.bvh"), load_target(SAMPLES / "rigs" / f"{rig}.json"))
    floor, body = result.supports.floor, result.matching.target
    heights = result.motion.positions[:, floor.joints] @ body.up_vector
    depths = np.where(floor.stiffness > 0, floor.heights * body.unit - heights, 0.0)
    assert depths.max() < 0.0025 * body.leg_length


def lowest_head(radius, tmp_path):
    """The least height of a child's head, with this radius, over the floor of a cartwheel, in the rotation copy and in
    the result [cm].
    """
    child = json.loads((SAMPLES / "child.json").read_text())
    for joint in child["joints"]:
        if not joint.get("end"):
            joint["radius"] = radius if joint["name"] == "Head" else 3.0
    path = tmp_path / "child.json"
    path.write_text(json.dumps(child))
    result = retarget(read_bvh(SAMPLES / "supports" / "cartwheel.bvh"), load_target(path))
    capsules = result.skins.target.capsules
    head = capsules.segments == SEGMENTS.index("head")
    lowest = [capsules.posed(motion)[..., 1] - capsules.radii for motion in (result.rotation_copy, result.motion)]
    return [heights[:, head].min() - heights[:20].min() for heights in lowest]


def test_a_large_head_stays_above_the_floor_of_a_cartwheel(tmp_path):
    copy, result = lowest_head(22.0, tmp_path)
    assert copy < -10
    assert result > -3


def test_the_root_rises_only_for_skin_that_would_be_below_the_floor():
    clip, undersides = on_floor_of(CRAWL, HERO)
    leg, rests = clip.leg_lengths[1], np.ones((len(CRAWL), 1))

    def rise(by, weights=rests):
        raised = clip.raised(np.outer(np.broadcast_to(by, len(clip)), UPWARDS))
        hands = replace(find_foot_lock(raised), weights=np.zeros((len(clip), 4)))
        supports = hands.with_joints(np.array([0]), np.array([0]), weights, np.zeros((len(clip), 1, 3)))
        return rise_of_flesh(raised, supports, find_flesh(raised, weights, undersides))

    assert not rise(leg).any()
    needed = rise(-0.5 * leg)
    assert (needed > 0).all()
    np.testing.assert_allclose(rise(needed - 0.5 * leg), 0, atol=1e-9)
    assert not rise(-0.5 * leg, 0 * rests).any()


def test_the_root_rises_for_skin_no_farther_than_the_legs_reach():
    """A trunk that reaches far below the floor does not lift the feet that rest beside it; on feet alone it bends."""
    clip, _ = on_floor_of(read_bvh(SAMPLES / "wave.bvh"), SAMPLES / "child.json")
    feet, leg = find_foot_lock(clip), clip.leg_lengths[1]
    feet = replace(feet, weights=np.ones_like(feet.weights))
    deep = Flesh(np.array([clip.pelvis]), np.full((len(clip), 1), 10.0 * leg))
    assert not rise_of_flesh(clip, feet, deep).any()
    held = feet.with_joints(np.array([0]), np.array([0]), np.ones((len(clip), 1)), np.zeros((len(clip), 1, 3)))
    hips = clip.raised(np.outer(rise_of_flesh(clip, held, deep), UPWARDS)).copy_on_path(
        np.array([pair.target.hip for pair in clip.legs])
    )
    reaches = np.linalg.norm(hips - feet.places[:, ::2], axis=2).max(axis=1) / leg
    np.testing.assert_allclose(reaches, 1.0, atol=0.01)


def test_skin_of_thighs_does_not_raise_the_root():
    """It goes where the feet are placed."""
    clip, undersides = on_floor_of(CRAWL, HERO)
    sunk = clip.raised(np.tile(-10.0 * clip.leg_lengths[1] * UPWARDS, (len(clip), 1)))
    joints = find_flesh(sunk, np.ones((len(clip), 1)), undersides).joints.tolist()
    assert clip.pelvis in joints
    assert not {pair.target.hip for pair in clip.legs} & {*joints}
