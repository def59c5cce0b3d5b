"""The stiffness of parts: which give way to contacts and feet, and which do not."""

import numpy as np
import pytest
from bodies import PERSON, SAMPLES, matched, swaying

from distretarget import load_target
from distretarget.baseline.rotation_copy import RootScale
from distretarget.objectives.clip import Clip
from distretarget.objectives.contact import (
    ADDED_LENGTH,
    BASE_STIFFNESS,
    LOOSE_FACTOR,
    ROOT_STIFFNESS,
    TRUNK_FACTOR,
    part_stiffness,
)

FEET = "LeftAnkle LeftToe RightAnkle RightToe"


def clip_on(target):
    """A short clip of the person, on a target."""
    return Clip.of(matched(swaying(PERSON, frames=2), target), RootScale.even(1.0))


def test_stiffness_grows_with_what_a_part_carries_and_head_hands_and_feet_are_stiff():
    clip = clip_on(PERSON)
    parts = clip.parts
    stiffness = part_stiffness(clip)
    at = {name: stiffness[parts[PERSON.index(name)]] for name in PERSON.names}
    assert at["Hips"] > at["Chest"] > at["LeftShoulder"] > at["LeftElbow"]
    assert at["LeftShoulder"] == at["RightShoulder"]
    assert stiffness[-1] == ROOT_STIFFNESS
    assert at["Hips"] > 5 * at["LeftElbow"]
    assert at["LeftAnkle"] > at["LeftKnee"]
    assert at["LeftWrist"] > at["LeftElbow"]
    assert at["Neck"] > at["LeftElbow"]


@pytest.mark.parametrize("names", ["Hips Chest LeftCollar LeftShoulder LeftElbow LeftHip LeftKnee", FEET])
def test_stiffness_grows_in_proportion_to_the_share_of_the_body_that_a_part_carries(names):
    """The share is that of the lengths of all bones; were it squared, say, arms and neck would hardly resist. A foot is
    five times as stiff: it turns least where the leg gives way to a place on the floor, so that the sole stays flat.
    """
    clip = clip_on(PERSON)
    stiffness, whole = part_stiffness(clip), PERSON.lengths.sum()
    for joint in map(PERSON.index, names.split()):
        carried = PERSON.lengths[[*PERSON.subtree(joint)]].sum() / whole
        bones = PERSON.lengths[list(PERSON.children[joint])].sum() / clip.unit
        usual = BASE_STIFFNESS * (bones + ADDED_LENGTH) * (1.0 + TRUNK_FACTOR * carried)
        np.testing.assert_allclose(stiffness[clip.parts[joint]], (5.0 if names == FEET else 1.0) * usual)


def test_a_root_on_the_floor_does_not_tip():
    """The parts above the pelvis carry all of the body on a long lever: the least turn would tip the body over."""
    rig = load_target(SAMPLES / "rigs" / "unreal_t.json").skeleton
    clip = clip_on(rig)
    root, pelvis = part_stiffness(clip)[clip.parts[[rig.index("root"), rig.index("pelvis")]]]
    assert root > 1e5 * pelvis


def test_only_fingers_that_nothing_drives_are_loose(monkeypatch):
    rig = load_target(SAMPLES / "rigs" / "unreal_t.json").skeleton
    clip = clip_on(rig)
    fingers = {f"{finger}_01_{side}" for finger in ("thumb", "index", "middle", "ring", "pinky") for side in "lr"}
    assert {
        rig.names[joint] for joint in clip.roots if rig.children[joint] and clip.parts[joint] in clip.loose_parts
    } == fingers
    loose = part_stiffness(clip)
    monkeypatch.setattr("distretarget.objectives.contact.LOOSE_FACTOR", 1.0)
    stiff = part_stiffness(clip)
    changed = np.flatnonzero(stiff != loose)
    np.testing.assert_array_equal(changed, clip.loose_parts)
    np.testing.assert_allclose(loose[changed], LOOSE_FACTOR * stiff[changed])
    assert not len(clip_on(PERSON).loose_parts)
