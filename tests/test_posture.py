"""Metrics of how head, palms and feet are held, on postures that are known by construction."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import LEG, UP, matched, person, posed, sample
from scipy.spatial.transform import Rotation
from skeleton_edits import in_axes, with_offset
from zoo import member, on_member, on_twin

from distretarget import Body, retarget
from distretarget.measure.comparison import Reference
from distretarget.measure.metrics import clip_metrics

TOES = 0.125 * np.array([0.0, -np.sin(np.radians(20)), np.cos(np.radians(20))])  # below the ankle, as those of people
PERSON = with_offset(person(), [person().index(f"{side}Toe") for side in ("Left", "Right")], TOES)
X, Y, Z = np.eye(3)
POSTURE = ("head_tilt", "palm_turn", "sole_tilt", "heading", "splay")


def standing(turns=None, body=PERSON, height=LEG, frames=30):
    """A body that stands, with joints turned by angles about axes [degrees]."""
    vectors = {name: np.radians(turn) for name, turn in (turns or {}).items()}
    return posed(body, vectors, np.zeros((frames, 3)) + height * UP)


def posture(source, result):
    """The metrics of posture that are not 0; None where nothing was measured."""
    tracks = Reference(source, matched(source, result.skeleton), UP).compare(result).tracks
    metrics = clip_metrics(tracks)
    return {key: metrics[key] for key in POSTURE if metrics[key] is None or metrics[key] > 1e-6}


@pytest.mark.parametrize(
    ("turns", "found"),
    [
        ({"Head": 90 * Z}, {"head_tilt": 90.0}),
        ({"Head": -25 * X}, {"head_tilt": 25.0}),
        ({"Head": 60 * Y}, {"heading": 60 / 3}),  # of one of head, left and right foot
        ({"LeftAnkle": 20 * Z}, {"sole_tilt": 20 / 2}),
        ({"LeftAnkle": 30 * Y}, {"heading": 30 / 3}),
        ({"LeftHip": 12 * Z, "LeftAnkle": -12 * Z}, {"splay": 12 / 2}),
        ({"LeftHip": -6 * Z, "RightHip": 6 * Z, "LeftAnkle": 6 * Z, "RightAnkle": -6 * Z}, {"splay": 6.0}),
        ({"LeftElbow": 50 * Y}, {}),
    ],
)
def test_each_metric_sees_its_fault_and_no_other(turns, found):
    assert posture(standing(), standing(turns)) == pytest.approx({"palm_turn": None, **found}, abs=1e-6)


def test_feet_that_a_source_turns_out_point_the_same_way_where_its_rest_pose_does_not_stand():
    source = on_member("character_creator", sample("squat")[:60])
    assert Body.of_motion(source).up_at_rest is None
    assert retarget(source, member("kimono")).metrics["result"]["heading"] < 0.1


def test_palms_turn_with_the_forearms():
    body = member("mixamo")
    height = Body.of(body).leg_length
    source = standing(body=body, height=height)
    result = standing({"mixamorig:LeftForeArm": 50 * X}, body, height)
    assert posture(source, result) == pytest.approx({"palm_turn": 50 / 2}, abs=0.01)


def random_axes(body, seed):
    return Rotation.random(len(body), random_state=seed)


JUMBLED = (0, 3, 5)  # seeds with which nobody can stand in the rest pose


@pytest.mark.parametrize("seed", JUMBLED)
def test_the_same_motion_on_a_rig_whose_rest_pose_is_a_jumble_has_no_fault(seed):
    source = in_axes(standing(), random_axes(PERSON, seed))
    assert not Body.of_motion(source).stands_at_rest
    np.testing.assert_allclose(source.positions, standing().positions, atol=1e-9)
    found = posture(source, standing())
    assert found == pytest.approx({"palm_turn": None}, abs=1e-6)


@pytest.mark.parametrize("seed", JUMBLED)
def test_a_fault_is_seen_on_such_a_rig_as_well(seed):
    """The head's axis is found from the neck, not from the alignment, which may have the fault."""
    source = in_axes(standing(), random_axes(PERSON, seed))
    found = posture(source, standing({"Head": 100 * Z}))
    assert found["head_tilt"] == pytest.approx(100.0, abs=1e-6)
    assert posture(source, standing({"LeftAnkle": 30 * Y}))["heading"] == pytest.approx(10.0, abs=1e-6)


def test_a_head_that_nods_about_its_mean_is_measured_from_the_mean():
    """On a rig that neither stands nor is built along its bones, what the head does on average is up."""
    nod = 20 * np.sin(np.linspace(0, 2 * np.pi, 31))[:30, None] * X
    source = in_axes(standing({"Head": nod}), random_axes(PERSON, 0))
    assert posture(source, standing({"Head": nod})) == pytest.approx({"palm_turn": None}, abs=0.5)


def bent(turns):
    """The clap with joints turned by angles about axes in all frames [degrees]."""
    clip = sample("clap")[:60]
    rotations = np.array(clip.rotations)
    for name, turn in turns.items():
        joint = clip.skeleton.index(name)
        rotations[:, joint] = (
            Rotation.from_quat(rotations[:, joint]) * Rotation.from_rotvec(turn, degrees=True)
        ).as_quat()
    return replace(clip, rotations=rotations)


lying = pytest.mark.parametrize("rig", ["lafan1", "character_creator", "bandai_lying"])


@lying
@pytest.mark.parametrize(
    ("turns", "key"),
    [
        ({"Neck": 25 * X, "Head": 30 * X}, "head_tilt"),
        ({"Neck": 20 * Y, "Head": 10 * Y}, "heading"),
        ({"LeftAnkle": 25 * Z}, "sole_tilt"),
    ],
)
def test_what_a_whole_clip_holds_bent_is_no_fault_on_a_rig_that_lies(rig, turns, key):
    """A dancer looks down or aside, and stands on the edge of a foot; the twin's motion is the known answer."""
    clip = bent(turns)
    assert posture(on_member(rig, clip), on_twin(rig, clip)).get(key, 0.0) == pytest.approx(0.0, abs=5.0)


@lying
@pytest.mark.parametrize(
    ("held", "fault", "found"),
    [
        ({"Neck": 25 * X, "Head": 30 * X}, {"Head": 60 * X}, {"head_tilt": 30.0}),
        ({"Neck": 20 * Y}, {"Head": 60 * Y}, {"heading": 60 / 3}),
        ({"LeftAnkle": 15 * Z}, {"LeftAnkle": 35 * Z}, {"sole_tilt": 20 / 2}),
    ],
)
def test_a_fault_in_such_a_clip_is_seen_all_the_same(rig, held, fault, found):
    motions = on_member(rig, bent(held)), on_twin(rig, bent({**held, **fault}))
    measured = posture(*motions)
    assert {key: measured[key] for key in found} == pytest.approx(found, abs=2.0)


@lying
def test_a_head_that_hangs_from_an_upright_neck_in_all_frames_is_not_measured(rig):
    clip = bent({"Head": 60 * X})
    assert posture(on_member(rig, clip), on_twin(rig, clip))["head_tilt"] is None


def test_a_head_that_stays_bent_is_measured_from_a_rest_pose_that_stands():
    """As a dancer's may in a whole clip; on a body without a motion, which does not stand, it is not measured."""
    bent = standing({"Head": 60 * X})
    assert posture(bent, standing())["head_tilt"] == pytest.approx(60.0)
    assert posture(standing(), standing(body=member("lafan1")))["head_tilt"] is None


def test_feet_in_the_air_and_feet_without_toes_are_not_measured():
    x = np.linspace(0, 60, 30)[:, None] * X
    kicking = standing({"LeftHip": -4 * x, "RightHip": 4 * x})
    assert posture(kicking, kicking)["sole_tilt"] is None
    assert posture(kicking, kicking)["splay"] is None
    body = member("no_toes")
    source = standing(body=body, height=Body.of(body).leg_length)
    assert posture(source, source).keys() == {"palm_turn"}
