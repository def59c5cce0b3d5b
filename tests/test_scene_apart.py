"""Thick performers keep apart, and sit on their skin: on seats and on laps."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from bodies import SAMPLES, UP, moved, sample
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from distretarget import Prop, retarget_scene
from distretarget.body.build import Build, Builds, average_build
from distretarget.io.obj import static_prop
from distretarget.measure.gaps import measure_skin_contacts
from distretarget.measure.skin import find_skin
from distretarget.measure.skin_touches import FARTHEST
from distretarget.objectives.contact_zones import IS_HARD
from distretarget.scene.props import PropSurface
from distretarget.scene.scene_file import load_scene
from distretarget.scene.skin import COUNT, Bodies, PropShape, _without_worse_bends
from distretarget.scene.sweeps import FLESH, IS_CORE, IS_SEAT, IS_THIGH, Core, _slowed
from distretarget.skin.capsules import IS_ARM

FAT = Build({part: np.multiply(ends, [1.0, 1.0, 1.0, 1.7]) for part, ends in average_build("adult").parts.items()})
SPEED = (
    0.1  # two performers part at most this fast; written here, so that the test does not follow the code [body units/s]
)


@cache
def scene(name):
    return load_scene(SAMPLES / "scenes" / name / "scene.json").read()


def solved(motions, props=(), **options):
    bodies = [motion.rigid_skeleton for motion in motions]
    return retarget_scene(motions, bodies, props, **options).results


@cache
def fat(name):
    motions, _ = scene(name)
    return solved(motions, builds=[Builds(target=FAT)] * len(motions)), solved(motions, skin="none")


def overlap(results, motions, parts=(IS_CORE, IS_CORE)):
    """(frames,), how deep the parts of two performers are in each other [body units]."""
    unit = results[0].skins.target.unit
    one, other = (
        Core.of(each.skins.target, motion, unit, some)
        for each, motion, some in zip(results, motions, parts, strict=True)
    )
    apart = np.linalg.norm(one.centres[:, :, None] - other.centres[:, None], axis=-1)
    return (one.radii[:, None] + other.radii - apart).max(axis=(1, 2))


def ball(x, radius):
    return Core(np.array([[x]], float), np.array([radius]))


def test_two_balls_part_by_the_way_until_they_touch():
    along = np.array([[1.0, 0.0, 0.0]])
    beside, above = ball([1.0, 0.0, 0.0], 1.0), ball([0.8, 0.6, 0.0], 1.0)
    origin = ball([0.0, 0.0, 0.0], 1.0)
    np.testing.assert_allclose(beside.distance_to_clear(origin, along, 0.0), 1.0)
    np.testing.assert_allclose(beside.distance_to_clear(origin, along, 0.3), 0.7)
    np.testing.assert_allclose(above.distance_to_clear(origin, along, 0.0), np.sqrt(4 - 0.36) - 0.8)
    assert origin.distance_to_clear(beside, along, 0.0) == 0.0  # it is not ahead


def test_they_part_before_they_have_to_and_slowly():
    need, speed = np.zeros(300), np.full(300, 0.01)
    need[150] = 1.0
    parted = _slowed(need, speed, 10)
    assert np.all(parted >= need - 1e-12)
    assert np.abs(np.diff(parted)).max() < 0.0101
    assert parted[0] < 0.01


@pytest.mark.parametrize("name", ["waltz", "lift"])
def test_thick_trunks_do_not_sink_into_each_other(name):
    thick, thin = fat(name)
    before = overlap(thick, [each.motion for each in thin])
    after = overlap(thick, [each.motion for each in thick])
    assert before.max() > 2.5 * FLESH
    assert after.max() < 1.5 * FLESH + max(overlap(thick, [each.source for each in thick]).max(), 0.0)


def test_a_small_partner_does_not_stand_in_the_thighs_of_a_tall_one():
    motions, _ = scene("waltz")
    bodies = [each.rigid_skeleton for each in motions]
    bodies[1] = bodies[1].with_lengths(0.45 * bodies[1].lengths)
    fat_ones = {"builds": [Builds(target=FAT)] * 2}
    thick, thin = (
        retarget_scene(motions, bodies, world_scale=0.35, **each).results for each in (fat_ones, {"skin": "none"})
    )
    parts = IS_THIGH, IS_CORE
    assert overlap(thick, [each.motion for each in thin], parts).max() > 2.5 * FLESH
    assert overlap(thick, [each.motion for each in thick], parts).max() < 2.0 * FLESH


@pytest.mark.parametrize("name", ["waltz", "lift"])
def test_resting_feet_stand_still_and_hands_stay_together(name):
    thick, thin = fat(name)
    for one, other in zip(thick, thin, strict=True):
        assert one.metrics["result"]["foot_skate"] < other.metrics["result"]["foot_skate"] + 0.01
        assert one.metrics["result"]["pop"] == 0
        steps = np.linalg.norm(np.diff(one.motion.root_positions - other.motion.root_positions, axis=0), axis=1)
        unit = one.skins.target.unit
        assert steps.max() < 2 * SPEED * unit * one.motion.frame_time


def test_bodies_that_nothing_brings_together_are_where_they_were():
    motions, _ = scene("handshake")
    thick, thin = solved(motions, skin="average"), solved(motions, skin="none")
    for one, other in zip(thick, thin, strict=True):
        np.testing.assert_array_equal(one.motion.root_positions, other.motion.root_positions)


@cache
def seated(build):
    (motion,), props = scene("sit_on_chair")
    return solved([motion], props, builds=[Builds(target=build)] if build else None)[0]


def test_a_thick_body_sits_higher_on_its_skin():
    body, seat = seated(FAT), 46.0
    skin = body.skins.target
    lowest = Core.of(skin, body.motion[-10:], 1.0, IS_SEAT)
    near = lowest.centres[..., 1] - lowest.radii
    hips = body.motion.positions[-10:, :1]
    under = np.linalg.norm((lowest.centres - hips)[..., [0, 2]], axis=-1) < 12.0
    assert abs(near[under].min() - seat) < 0.02 * body.matching.target.height
    assert seated(None).motion.positions[-1, 0, 1] < body.motion.positions[-1, 0, 1] - 2.0
    assert body.metrics["result"]["foot_skate"] < 0.01


def test_a_thick_body_sits_higher_on_a_lap():
    (motion,), _ = scene("sit_on_chair")
    below = motion[100:]
    forwards = below.positions[0, below.skeleton.index("LeftKnee")] - below.positions[0, 0]
    forwards *= [1.0, 0.0, 1.0]
    shift = 25.0 * forwards / np.linalg.norm(forwards) + 16.0 * UP
    both = [moved(below, Rotation.identity(), shift=tuple(shift)), below]
    thick = solved(both, builds=[Builds(target=FAT)] * 2)
    thin = solved(both, skin="none")
    parts = (IS_SEAT, IS_THIGH)
    before, after = (overlap(thick, [each.motion for each in some], parts).max() for some in (thin, thick))
    assert before > 2 * FLESH
    assert after < 2 * FLESH
    rise = [
        one.motion.positions[-1, 0, 1] - other.motion.positions[-1, 0, 1]
        for one, other in zip(thick, thin, strict=True)
    ]
    assert rise[0] > 2.0
    assert abs(rise[1]) < 1.0  # who is below stays


@pytest.mark.parametrize(("thickness", "wall_from"), [(1.0, 1.0), (1.4, -6.0), (1.4, -3.0)])
def test_a_wall_that_leaves_an_arm_no_room_makes_it_no_worse(thickness, wall_from):
    """Between a thick trunk and a wall through it, a hanging arm goes no deeper into either than without skin."""
    motion = sample("wave")[:40]
    wrists = motion.positions[:, [motion.skeleton.index(name) for name in ("LeftWrist", "RightWrist")]]
    hanging = wrists[:, wrists[..., 1].max(axis=0).argmin()].mean(axis=0)
    side = np.sign(hanging[0] - motion.positions[:, 0, 0].mean())
    box = hanging[0] + side * np.array([wall_from, 30.0])
    corners = np.array([[x, y, z] for x in sorted(box) for y in (0.0, 180.0) for z in (-80.0, 80.0)])
    hull = ConvexHull(corners)
    triangles = hull.simplices
    faces = corners[triangles]
    inwards = (np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]) * hull.equations[:, :3]).sum(axis=1) < 0
    triangles = np.where(inwards[:, None], triangles[:, ::-1], triangles)
    wall = static_prop(np.array(corners, float), "wall")
    prop = Prop(name="wall", motion=wall, surface=PropSurface.of_mesh(corners - wall.positions[0, 0], triangles))
    fatter = Build({part: ends * [1.0, 1.0, 1.0, thickness] for part, ends in FAT.parts.items()})
    thick = solved([motion], [prop], builds=[Builds(target=fatter)])
    thin = solved([motion], [prop], skin="none")
    skin = thick[0].skins.target
    shapes = [PropShape(prop.surface, np.zeros((1, COUNT), bool), np.zeros((1, COUNT), bool))]
    still = replace(wall[np.zeros(len(motion), int)], frame_time_text=motion.frame_time_text)
    bodies = Bodies([skin], shapes=shapes, moved=lambda _motions: [still])
    arms = np.isin(bodies.balls.pairs[:, 0], np.flatnonzero(IS_ARM))
    after, before = (np.maximum(-bodies.gaps([each[0].motion])[:, arms], 0.0).max(axis=1) for each in (thick, thin))
    assert before.max() > 0.02
    assert np.all(after < before + 0.011)


@pytest.mark.parametrize("name", ["handshake", "high_five", "lift", "push"])
def test_hands_that_touch_another_performer_are_not_in_their_own_body(name):
    for one in fat(name)[0]:
        skin = one.skins.target
        hands = np.isin(skin.balls.pairs[:, 0], np.flatnonzero(IS_HARD))
        assert Bodies([skin]).gaps([one.motion])[:, hands].min() > -0.005  # body units


def test_what_is_no_prop_keeps_no_limb_from_bending():
    """A limb that ends deeper in another performer has left something else on its way."""
    shallow, deep = ([each.motion for each in results] for results in fat("waltz"))
    bodies = Bodies([each.skins.target for each in fat("waltz")[0]])
    assert bodies.gaps(deep).min() < bodies.gaps(shallow).min() - 0.02
    one = SimpleNamespace(clip=SimpleNamespace(shots=np.zeros(len(deep[0]))))
    for kept, motion in zip(_without_worse_bends([one], bodies, shallow, deep), deep, strict=True):
        np.testing.assert_array_equal(kept.rotations, motion.rotations)


def test_gaps_between_skins_are_told():
    thick, motions = fat("waltz")[0], scene("waltz")[0]
    gap = retarget_scene(motions, [motion.rigid_skeleton for motion in motions], skin="average").skin_gaps[0, 1]
    assert gap.frames > 100
    assert gap.error < 0.5  # on bodies as thick as the source
    assert (
        f"{gap.error:.1f} % of height on average, worst in frame {gap.worst.frame} ({gap.worst.parts[0]}"
        in gap.sentence
    )
    assert thick[0].skins
    one, other = thick[0], thick[0].motion
    skin = find_skin(one.matching.target, one.skins.target.capsules)
    away = replace(other, root_positions=other.root_positions + 1000.0)
    assert measure_skin_contacts([other, away], [other, away], [skin] * 2, [skin] * 2) is None
    far = measure_skin_contacts([other, other], [other, away], [skin] * 2, [skin] * 2)
    assert far.frames == len(other)
    assert far.error == pytest.approx(FARTHEST, rel=0.1)
