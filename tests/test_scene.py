"""Scenes: performers who touch go on touching, in sweeps, whichever way they look, by pairs of their joints."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bodies import SAMPLES, lengthened, moved, sample, sample_target
from characters import LOOKING_BACK, Bones, as_vrm0, box_mesh, character
from program import run
from scipy.spatial.transform import Rotation

from distretarget import (
    MotionError,
    Options,
    SettingsError,
    load_target,
    read_bvh,
    read_motion,
    retarget,
    retarget_scene,
    write_bvh,
    write_motion,
)
from distretarget.baseline.rotation_copy import RootScale
from distretarget.ik.poses import Poses
from distretarget.ik.springs import Springs
from distretarget.objectives.activation import DEFAULT_SETTINGS as DEFAULT
from distretarget.objectives.activation import ContactSettings
from distretarget.objectives.contact import solve_contact
from distretarget.objectives.supports import no_supports
from distretarget.pipeline.performer import Performer, Transfer, match_performer
from distretarget.scene.contacts import (
    TRUNK_COMPLIANCE,
    ContactPoints,
    find_performer_contacts,
    find_scene_contacts,
    joint_compliance,
)
from distretarget.scene.sweeps import MOST_SHORTFALL, MOST_SWEEPS, changed_steadily, with_shortfall

H = {"Chest": 0.9, "Elbow": 0.75, "Wrist": 0.8, "Knee": 1.2, "Ankle": 1.2}
HAND = "RightWrist"


@cache
def leaning():
    """A person who leans with the right hand on a wall, half a second and more at half the frames."""
    return sample("supports/hand_on_wall")[::2]


@cache
def pair(gap=2.0):
    """Two persons, face to face, who lean on each other's right hand: `gap` apart [cm]."""
    one = leaning()
    middle = np.median(one.positions[:, one.skeleton.index(HAND)], axis=0)
    turn = Rotation.from_euler("Y", 180, degrees=True)
    facing = np.array([0.0, 0.0, gap])
    other = moved(one, turn, shift=tuple(middle * [2, 0, 2] + facing))
    return one, other


@cache
def bodies():
    skeleton = leaning().rigid_skeleton
    return sample_target("child").for_source(skeleton).skeleton, lengthened(skeleton, H)


@cache
def duet():
    return retarget_scene(pair(), bodies())


def gap_of(motions):
    hands = [motion.positions[:, motion.skeleton.index(HAND)] for motion in motions]
    return np.linalg.norm(hands[0] - hands[1], axis=1)


def size():
    return duet().results[0].matching.target.height


def test_hands_that_touch_go_on_touching():
    source = gap_of(pair())
    together = source < 6
    assert together.sum() > 40
    alone = gap_of([retarget(motion, body).motion for motion, body in zip(pair(), bodies(), strict=True)])
    scene = gap_of([result.motion for result in duet().results])
    assert alone[together].mean() > 15
    assert scene[together].mean() < source[together].mean() + 3


def test_the_gaps_of_the_scene_are_measured_and_both_stand_on_the_floor():
    gap, copy = duet().gaps[0, 1], duet().copy_gaps[0, 1]
    assert gap.frames == copy.frames > 40
    assert gap.b < 2 * gap.a < copy.b
    assert 1 < duet().sweeps <= MOST_SWEEPS
    assert 0 < duet().gap_error < 0.02
    for result in duet().results:
        metrics = result.metrics["result"]
        assert metrics["foot_height"] < 0.2
        assert metrics["not_converged"] == 0


@cache
def performers():
    """Both performers, before they are solved."""
    scales = [RootScale(duet().world_scale, result.root_scale) for result in duet().results]
    matches = [match_performer(Transfer(*both)) for both in zip(pair(), bodies(), strict=True)]
    both = zip(matches, scales, strict=True)
    return [Performer.of(match, scale).with_supports(Options(), DEFAULT) for match, scale in both]


def hips_of(result):
    joints = [leg.hip for leg in result.matching.target.legs]
    return result.motion.positions[:, joints]


def test_contacts_leave_the_hips_where_they_are_alone():
    """Arms and trunks meet; nobody crouches or is dragged."""
    for one, result in zip(find_scene_contacts(performers(), []).performers, duet().results, strict=True):
        alone = one.result(solve_contact(one.clip, one.supports, one.settings))
        assert np.linalg.norm(hips_of(result) - hips_of(alone), axis=-1).max() < 0.01 * size()


def test_limbs_go_as_far_as_they_are_long_and_standing_feet_as_little_as_the_trunk():
    one = performers()[0]
    compliance, skeleton, least = joint_compliance(one), one.clip.skeleton, TRUNK_COMPLIANCE * one.clip.unit
    arm = skeleton.paths_from(skeleton.index("RightShoulder"))[skeleton.index(HAND)]
    alone = replace(one, supports=no_supports(len(one.clip)))
    np.testing.assert_allclose(joint_compliance(alone)[:, skeleton.index(HAND)], least + arm)
    np.testing.assert_allclose(compliance[:, skeleton.index("Chest")], least)
    ankle = one.clip.target_legs[0].ankle
    stands = one.supports.weights[:, list(one.supports.joints).index(ankle)] == 1.0
    assert stands.any()
    np.testing.assert_allclose(compliance[stands, ankle], least)


@pytest.mark.parametrize("cut", [False, True])
def test_what_contacts_change_is_smooth_but_at_cuts(cut):
    """A sudden change of pose is spread over the frames around it, unless it comes with a cut of any performer."""
    contacts = find_scene_contacts(performers(), [])
    frames = len(contacts.performers[0].clip)
    before = Poses(np.ones((frames, 2, 3)), np.zeros((4, frames)))
    sudden = replace(before, v=before.v + (np.arange(frames) >= frames // 2)[:, None, None])
    if cut:
        shots = (np.arange(frames) >= frames // 2).astype(np.intp)
        one, other = contacts.performers
        contacts = replace(contacts, performers=(one, replace(other, clip=replace(other.clip, shots=shots))))
    steps = np.abs(np.diff(changed_steadily(sudden, before, contacts).v, axis=0)).max()
    assert steps == (pytest.approx(1.0) if cut else pytest.approx(0.2, abs=0.15))
    np.testing.assert_allclose(changed_steadily(before, before, contacts).v, before.v)


def test_two_performers_on_their_own_bodies_are_not_touched():
    own = [motion.rigid_skeleton for motion in pair()]
    done = retarget_scene(pair(), own)
    assert done.sweeps == 1
    for result, source, body in zip(done.results, pair(), own, strict=True):
        expected = retarget(source, body).motion
        np.testing.assert_allclose(result.motion.positions, expected.positions, atol=1e-9 * size())


def test_performers_stand_on_the_same_floor_as_alone():
    """Also on characters whose soles are thick, and where the floor of one source is lower."""
    one, hero = leaning(), load_target(SAMPLES.parent / "sample_characters" / "hero.glb")
    lower = moved(leaning(), Rotation.identity(), shift=(1000.0, -4.0, 0.0))
    alone = retarget(one, hero)
    for performer, shift in zip(retarget_scene([one, lower], [hero] * 2).results, (0.0, 1000.0), strict=True):
        off = performer.motion.positions - alone.motion.positions - [shift * performer.root_scale, 0.0, 0.0]
        assert np.abs(off).max() < 1e-6 * size()
        for key in ("floor", "foot_height"):
            assert performer.metrics["result"][key] == pytest.approx(alone.metrics["result"][key], abs=0.01)


def test_the_order_of_the_performers_does_not_matter():
    swapped = retarget_scene(pair()[::-1], bodies()[::-1]).results[::-1]
    for one, other in zip(duet().results, swapped, strict=True):
        assert np.abs(one.motion.positions - other.motion.positions).max() < 1e-4 * size()


@pytest.mark.parametrize(("angle", "bound"), [(0, 1e-9), (70, 1e-4)])
def test_a_scene_that_is_moved_and_turned_has_the_same_result(angle, bound):
    turn, shift = Rotation.from_euler("Y", angle, degrees=True), (300.0, 0.0, -200.0)
    elsewhere = retarget_scene([moved(motion, turn, shift) for motion in pair()], bodies())
    scale = duet().world_scale
    for one, other in zip(duet().results, elsewhere.results, strict=True):
        expected = turn.apply(one.motion.positions.reshape(-1, 3)) + scale * np.array(shift)
        assert np.abs(expected - other.motion.positions.reshape(-1, 3)).max() < bound * size()


def with_a_double(name):
    """The supports of a sample performer alone, and in a scene with another who moves alike 2 cm beside."""
    source = sample(f"supports/{name}")[::2]
    child = sample_target("child")
    scene = retarget_scene([source, moved(source, Rotation.identity(), shift=(2.0, 0.0, 0.0))], [child] * 2)
    return retarget(source, child).supports, scene.results[0].supports


def test_on_a_ladder_hands_that_another_performer_touches_give_way_and_feet_do_not():
    """Hands go where the two performers meet; a body whose feet gave way would lose its stand."""
    alone, touched = with_a_double("climb_ladder")
    feet = slice(alone.feet)
    np.testing.assert_allclose(touched.weights[:, feet], alone.weights[:, feet], atol=1e-12)
    held = alone.weights[:, alone.feet :] > 0.99
    assert held.any()
    assert touched.weights[:, alone.feet :][held].max() < 0.01


@pytest.mark.parametrize(("height", "yields"), [(0.15, False), (0.25, True)])
def test_hands_give_way_from_a_fifth_of_a_leg_above_the_floor_on(height, yields):
    """Below that they rest on the floor, with the flesh of the hand or a shoe between."""
    match = match_performer(Transfer(leaning(), bodies()[0]))
    one = Performer.of(match, RootScale.even(0.6)).with_supports(Options(), DEFAULT)
    places = np.array(one.supports.places)
    floor = one.clip.scale.height * one.clip.source_floor[:, None]
    places[..., 1] = floor + height * one.clip.leg_lengths[1]
    one = replace(one, supports=replace(one.supports, places=places))
    touched = find_scene_contacts([one, one], []).performers[0].supports
    hands = slice(one.supports.feet, None)
    weights = one.supports.weights[:, hands]
    assert weights.max() == 1.0
    expected = 0.0 if yields else weights[weights > 0.99]
    np.testing.assert_allclose(touched.weights[:, hands][weights > 0.99], expected, atol=1e-12)


def test_all_performers_stand_in_the_world_of_the_first():
    """The axis that points up in it is that of all others, whatever their own files say."""
    one, other = (replace(body, up=up) for body, up in zip(bodies(), ("Z", "Y"), strict=True))
    done = retarget_scene(pair(), [one, other])
    assert [result.world.up for result in done.results] == ["Z", "Z"]


@pytest.mark.parametrize("first", [0, 1])
def test_targets_in_different_units_are_of_one_world(first):
    """A body in metres moves as the same body in centimetres does, and its result is in metres."""
    in_cm = bodies()
    in_m = in_cm[1].with_offsets(0.01 * in_cm[1].offsets)
    order = slice(None, None, -1 if first else 1)
    alike, mixed = (retarget_scene(pair()[order], [in_cm[0], other][order]) for other in (in_cm[1], in_m))
    assert mixed.units == pytest.approx((1.0, 100.0) if first else (1.0, 0.01))
    assert alike.units == (1.0, 1.0)
    for one, other, factor in zip(alike.motions, mixed.motions, (1.0, 0.01)[order], strict=True):
        size = np.abs(one.positions).max()
        np.testing.assert_allclose(other.positions / factor, one.positions, atol=1e-6 * size)


def test_scenes_that_cannot_be_are_refused():
    one, other = pair()
    short = other[:20]
    with pytest.raises(MotionError, match="performer 2 has 20 frames"):
        retarget_scene([one, short], bodies())
    with pytest.raises(MotionError, match="frame time"):
        retarget_scene([one, replace(other, frame_time_text="0.01")], bodies())
    with pytest.raises(MotionError, match="different units"):
        retarget_scene([one, other], [bodies()[0], bodies()[1].with_offsets(1e-4 * bodies()[1].offsets)])
    with pytest.raises(SettingsError, match="2 sources, 1 targets"):
        retarget_scene([one, other], bodies()[:1])
    with pytest.raises(SettingsError, match="world_scale is 0"):
        retarget_scene([one, other], bodies(), world_scale=0)


def test_the_world_is_no_larger_than_the_shortest_legs_can_follow():
    walk = sample("walk")
    child = sample_target("child").for_source(walk.rigid_skeleton).skeleton
    giant = sample_target("giant").for_source(walk.rigid_skeleton).skeleton
    sources = [walk, moved(walk, Rotation.identity(), shift=(500.0, 0.0, 0.0))]
    done = retarget_scene(sources, [child, giant])
    assert done.results[0].root_scale == pytest.approx(0.6)
    assert done.world_scale == pytest.approx(0.6 * done.longest_strides[0])
    larger = retarget_scene(sources, [child, giant], world_scale=1.25)
    assert larger.world_scale / larger.results[0].root_scale > larger.longest_strides[0]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    one, other = pair()
    write_bvh(tmp_path / "lead.bvh", one)
    write_bvh(tmp_path / "follow.bvh", other[:60])
    return tmp_path


def test_the_command_writes_a_file_for_each_performer(folder):
    done = run("scene", "lead.bvh", "follow.bvh", "--cut", "-t", SAMPLES / "child.json", "-o", "duet")
    assert done.returncode == 0, done.stderr
    assert "lead and follow: contacts in " in done.stdout
    for name in ("lead", "follow"):
        assert len(read_bvh(folder / "duet" / f"{name}.bvh")) == 60
    again = run("scene", "lead.bvh", "follow.bvh", "--cut", "-t", SAMPLES / "child.json", "-o", "duet")
    assert again.returncode == 1
    assert "exists" in again.stderr


def test_results_of_clips_with_one_name_are_numbered(folder):
    (folder / "two").mkdir()
    write_bvh(folder / "two" / "lead.bvh", pair()[1])
    done = run("scene", "lead.bvh", "two/lead.bvh", "-t", SAMPLES / "child.json", "-o", "duet")
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in (folder / "duet").iterdir()) == ["lead_1.bvh", "lead_2.bvh"]


@pytest.mark.usefixtures("folder")
def test_the_command_refuses_what_cannot_be():
    child = SAMPLES / "child.json"
    for arguments, status, words in (
        (["lead.bvh", "follow.bvh", "-t", child], 1, "performer 2 has 60 frames"),
        (["lead.bvh", "follow.bvh", "-t", child, "-t", child, "-t", child], 2, "3 targets for 2 performers"),
    ):
        done = run("scene", *arguments, "-o", "out")
        assert done.returncode == status
        assert words in done.stderr
        assert len(done.stderr.splitlines()) == 1


REGIONS = np.array([0, 1, 1, 2])
PLACES = np.array([[0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [2.0, 1.0, 0.0]])


def springs(places=PLACES, stiffness=(1.0, 1.0, 1.0)):
    """Springs of joints 1, 2 (one region) and 3 (another), in one frame."""
    A = np.array(stiffness)[None, :, None, None] * np.eye(3)
    return Springs(np.array([1, 2, 3]), np.full(3, -1), places[None], A)


def reached(off):
    """The positions of all joints, off their places by so much."""
    return np.concatenate([np.zeros((1, 3)), PLACES + off])[None]


def test_a_region_is_drawn_further_by_what_it_fell_short():
    short = np.array([[0.0, -0.004, 0.0], [0.0, -0.004, 0.0], [0.002, 0.0, 0.0]])
    further = with_shortfall(springs(), springs(), reached(short), REGIONS)
    np.testing.assert_allclose(further.rest[0], PLACES - short)
    against = np.array([[0.0, 0.5, 0.0], [0.0, -0.5, 0.0], [0.0, 0.0, 0.0]])
    further = with_shortfall(springs(), springs(), reached(against), REGIONS)
    np.testing.assert_allclose(further.rest[0], PLACES, atol=1e-12)
    far = np.array([[0.0, 0.0, -3.0]] * 3)
    further = with_shortfall(springs(), springs(), reached(far), REGIONS)
    np.testing.assert_allclose(further.rest[0] - PLACES, [[0.0, 0.0, MOST_SHORTFALL]] * 3)
    short = np.array([[0.0, -0.004, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    before = springs(stiffness=(3.0, 1.0, 1.0))
    further = with_shortfall(before, before, reached(short), REGIONS)
    np.testing.assert_allclose(further.rest[0, :, 1] - 1.0, [0.003, 0.003, 0.0])
    none = springs(stiffness=(0.0, 0.0, 0.0))
    further = with_shortfall(none, none, reached(np.full((3, 3), 0.5)), REGIONS)
    np.testing.assert_array_equal(further.rest, none.rest)


BONES = Bones.of(sample("walk").skeleton)


@cache
def walks():
    walk = sample("walk")[:20]
    return walk, moved(walk, Rotation.identity(), shift=(0.0, 0.0, 400.0))


@pytest.fixture
def heroes(tmp_path):
    """The files of one character that looks to -Z, and of the same that looks to +Z."""
    back = BONES.turned(LOOKING_BACK)
    return (
        as_vrm0(character(back, meshes=[box_mesh(back)])).write(tmp_path / "back.vrm"),
        character(BONES, meshes=[box_mesh(BONES)]).write(tmp_path / "ahead.glb"),
    )


def test_who_looks_to_minus_z_moves_among_others_as_who_looks_to_z(heroes):
    back, ahead = map(load_target, heroes)
    assert back.skeleton.faces_negative_z
    mixed, alike = (retarget_scene(walks(), [one, ahead]) for one in (back, ahead))
    for one, other in zip(mixed.results, alike.results, strict=True):
        assert not one.motion.skeleton.faces_negative_z
        # The triangles of the two files are in other orders, and so are the points on them that skins are measured at.
        np.testing.assert_allclose(one.motion.positions, other.motion.positions, atol=0.01)
    vertices = [np.unique(each.results[0].mesh.vertices.round(5), axis=0) for each in (mixed, alike)]
    np.testing.assert_allclose(*vertices, atol=1e-4)


def test_the_file_of_who_looks_to_minus_z_is_that_of_retarget(heroes, tmp_path):
    targets = [*map(load_target, heroes)]
    apart = retarget_scene(walks(), targets, world_scale=retarget(walks()[0], targets[0]).root_scale)
    write_motion(tmp_path / "scene.vrm", apart.results[0].motion, heroes[0])
    write_motion(tmp_path / "alone.vrm", retarget(walks()[0], targets[0]).motion, heroes[0])
    scene, alone = (read_motion(tmp_path / f"{name}.vrm") for name in ("scene", "alone"))
    assert scene.skeleton.faces_negative_z
    rise = scene.positions[0, 0] - alone.positions[0, 0]  # a scene has one floor for all
    np.testing.assert_allclose(rise[[0, 2]], 0.0, atol=1e-6)
    np.testing.assert_allclose(scene.positions, alone.positions + rise, atol=1e-6)


def test_an_error_of_a_target_names_its_file(tmp_path):
    walk, child = SAMPLES / "walk.bvh", SAMPLES / "child.json"
    small = {"format": "distretarget-skeleton", "version": 1, "scale": 1e-4}
    (tmp_path / "small.json").write_text(json.dumps(small))
    done = run(
        "scene", walk, SAMPLES / "squat.bvh", "--cut", "-t", tmp_path / "small.json", "-t", child, "-o", tmp_path
    )
    assert "different units" in done.stderr
    assert "child.json" in done.stderr


FRAMES = 5
UP = np.array([0.0, 1.0, 0.0])
BETWEEN = np.array([2.0, 1.0, 2.0])  # from the joint of the second performer to that of the first


def points(place, target_reach):
    """A performer's only joint, with a path of 60 from the pelvis in the source."""
    source = np.broadcast_to(place, (FRAMES, 1, 3))
    reaches = np.array([60.0]), np.array([target_reach])
    return ContactPoints(np.array([0]), np.array([0]), np.array(source), *reaches, np.zeros(FRAMES, np.intp))


def found(scale, *reaches):
    one, other = points(BETWEEN, reaches[0]), points(np.zeros(3), reaches[1])
    return find_performer_contacts(one, other, scale, UP, 0.02, ContactSettings())


def test_a_gap_is_off_by_what_its_length_is():
    contacts = found(RootScale.even(1.0), 60.0, 60.0)
    one = np.full((FRAMES, 1, 3), 4.0)
    for other, gap in ((one - 2.0 * BETWEEN, 6.0), (one + BETWEEN, 3.0)):
        gaps, wanted = contacts.gaps(one, other)
        np.testing.assert_allclose(gaps, gap)
        np.testing.assert_allclose(wanted, 3.0)


@pytest.mark.parametrize("cut_of", [0, 1])
def test_a_contact_right_after_a_cut_of_either_performer_does_not_set_in_before_it(cut_of):
    """Their clips are cut apart or together; either way what comes after a cut says nothing of what was before."""
    frames = 40
    shots = np.zeros((2, frames), np.intp)
    shots[cut_of, 20:] = 1
    places = np.where(np.arange(frames)[:, None] < 20, 10.0, 1.0) * BETWEEN
    both = [
        replace(points(BETWEEN, 60.0), source=source[:, None], shots=own)
        for source, own in zip((places, np.zeros((frames, 3))), shots, strict=True)
    ]
    contacts = find_performer_contacts(*both, RootScale.even(1.0), UP, 0.02, ContactSettings())
    assert contacts.frames.tolist() == list(range(20, frames))


@pytest.mark.parametrize("on", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("gives", [(1.0, 1.0), (30.0, 10.0)])
def test_both_go_to_where_they_meet_by_how_far_they_can(gives, on):
    """They meet as far apart as in the source; a contact that sets in moves them by its share from where they are."""
    near = found(RootScale.even(1.0), 60.0, 60.0)
    near = replace(near, f=np.full(len(near.frames), on))
    one, other = np.full((FRAMES, 1, 3), 7.0), np.full((FRAMES, 1, 3), -2.0)
    given = tuple(np.full((FRAMES, 1), give) for give in gives)
    units = 4.0, 2.0
    springs = near.springs((one, other), (one, other), given, units)
    places = [unit * each.rest for unit, each in zip(units, springs, strict=True)]
    np.testing.assert_allclose(places[0] - places[1], np.where(on, 9.0 + on * (near.vectors[:, None] - 9.0), 9.0))
    moved = [np.linalg.norm(place - at) for place, at in zip(places, (one, other), strict=True)]
    np.testing.assert_allclose(gives[1] * moved[0], gives[0] * moved[1], atol=1e-9)


def test_hands_that_are_merely_near_do_not_touch():
    """Two hands may be as far apart as two of one body, not twice as far because two bodies are between them."""
    for share, touches in ((0.9, True), (1.5, False)):
        away = share * ContactSettings().reach * 60.0 * np.array([1.0, 0.0, 0.0])
        both = points(away, 60.0), points(np.zeros(3), 60.0)
        contacts = find_performer_contacts(*both, RootScale.even(1.0), UP, 0.02, ContactSettings())
        assert bool(len(contacts.frames)) == touches


@pytest.mark.parametrize(
    ("reaches", "scale", "gap"),
    [
        ((90.0, 90.0), RootScale(1.5, 1.2), [3.0, 1.2, 3.0]),  # as the floor's along it, and as the bodies' upwards
        ((60.0, 120.0), RootScale(1.5, 1.2), [3.0, 1.2, 3.0]),
        ((60.0, 60.0), RootScale.even(1.5), BETWEEN),  # both paths together are as long as in the source
        ((45.0, 75.0), RootScale.even(1.5), BETWEEN),
    ],
)
def test_gaps_have_the_scale_of_the_world_and_do_not_grow_with_legs_alone(reaches, scale, gap):
    touching = found(scale, *reaches)
    assert touching.frames.tolist() == list(range(FRAMES))
    np.testing.assert_allclose(touching.vectors, np.tile(gap, (FRAMES, 1)))
