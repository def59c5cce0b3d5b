"""Directions of bones, relative to the rest poses where bones point differently in every build."""

import numpy as np
import pytest
from bodies import PERSON, matched, posed, swaying
from scipy.spatial.transform import Rotation

from distretarget import retarget
from distretarget.measure.movement import direction_error, expected_directions, shared_bones


def errors(source, result):
    """The mean error of each bone by the name of its lower joint."""
    matching = matched(source, result.skeleton)
    bones = shared_bones(matching)
    values = direction_error(expected_directions(source, matching), result, bones)
    assert values.shape == (len(source), len(PERSON) - 1)
    return dict(zip(PERSON.names[1:], values.mean(axis=0), strict=True))


def rebuilt(turns):
    """The person with the rest directions of some bones turned about z [degrees], by the name of the lower joint."""
    offsets = np.array(PERSON.offsets)
    for name, degrees in turns.items():
        joint = PERSON.index(name)
        offsets[joint] = Rotation.from_euler("z", degrees, degrees=True).apply(offsets[joint])
    return PERSON.with_offsets(offsets)


def test_bones_of_another_build_are_no_error_on_the_rotation_copy():
    """Sloping collar bones and shoulders, a bent neck: the rotations of the source belong to these bones too."""
    body = rebuilt({"LeftCollar": 20, "LeftShoulder": -15, "RightShoulder": 15, "Head": 10, "Chest2": 5})
    source = swaying(PERSON)
    found = errors(source, retarget(source, body).rotation_copy)
    assert max(found.values()) == pytest.approx(0.0, abs=1e-6)


def test_a_bone_of_another_build_is_measured_from_its_own_direction():
    body = rebuilt({"LeftShoulder": -15})
    source = swaying(PERSON, angle=0.0)
    shoulder, turn = body.index("LeftCollar"), np.radians([0, 0, 15.0])
    found = errors(source, posed(body, {"LeftCollar": turn}, source.root_positions, source.frame_time_text))
    assert found["LeftShoulder"] == pytest.approx(15.0)
    assert body.parents[body.index("LeftShoulder")] == shoulder


def test_arms_and_legs_point_as_the_sources_do():
    """An A-pose body whose arms hang where the source's are spread is off by the angle between them."""
    body = rebuilt({"LeftElbow": -40, "RightElbow": 40})
    source = swaying(PERSON, angle=0.0)
    found = errors(source, posed(body, {}, source.root_positions, source.frame_time_text))
    assert found["LeftElbow"] == pytest.approx(40.0)
    assert found["LeftKnee"] == pytest.approx(0.0, abs=1e-6)
    assert max(errors(source, retarget(source, body).rotation_copy).values()) == pytest.approx(0.0, abs=1e-6)
