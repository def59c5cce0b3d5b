"""The stiffness of parts: which give way to contacts and feet, and which do not."""

from dataclasses import replace

import numpy as np
from bodies import SAMPLES, matched, person

from distretarget import load_target
from distretarget.distances import distance_problem
from distretarget.ik.poses import PoseProblem
from distretarget.ik.rigid_parts import part_of_joint, rigid_part_roots
from distretarget.objectives.contact import part_stiffness
from distretarget.objectives.settings import ContactSettings

PERSON = person()
SETTINGS = ContactSettings()


def problem_of(target):
    """A frame of the person in its rest pose, on a target."""
    matching = matched(PERSON, target)
    roots = rigid_part_roots(matching)
    return PoseProblem(
        skeleton=target,
        legs=matching.target.legs,
        unit=matching.target.unit,
        roots=roots,
        parts=part_of_joint(target, roots),
        distances=distance_problem(PERSON, target, matching.drivers),
        regions=matching.regions,
        source=PERSON.rest_positions[None],
        copy=target.rest_positions[None],
        root=np.zeros((1, 3)),
        frame_time=1.0,
    )


def test_stiffness_grows_with_what_a_part_carries_and_feet_are_stiff():
    problem = problem_of(PERSON)
    parts = problem.parts
    stiffness = part_stiffness(problem, SETTINGS)
    at = {name: stiffness[parts[PERSON.index(name)]] for name in PERSON.names}
    assert at["Hips"] > at["Chest"] > at["LeftShoulder"] > at["LeftElbow"] > at["LeftWrist"]
    assert at["LeftShoulder"] == at["RightShoulder"]
    assert stiffness[-1] == SETTINGS.root_stiffness
    assert at["Hips"] > 5 * at["LeftWrist"]
    assert at["LeftAnkle"] > at["LeftKnee"]


def test_only_fingers_that_nothing_drives_are_loose():
    rig = load_target(SAMPLES / "rigs" / "unreal_t.json").skeleton
    problem = problem_of(rig)
    fingers = {f"{finger}_01_{side}" for finger in ("thumb", "index", "middle", "ring", "pinky") for side in "lr"}
    assert {
        rig.names[joint]
        for joint in problem.roots
        if rig.children[joint] and problem.parts[joint] in problem.loose_parts
    } == fingers
    stiff = part_stiffness(problem, replace(SETTINGS, loose_factor=1.0))
    loose = part_stiffness(problem, SETTINGS)
    changed = np.flatnonzero(stiff != loose)
    np.testing.assert_array_equal(changed, problem.loose_parts)
    np.testing.assert_allclose(loose[changed], SETTINGS.loose_factor * stiff[changed])
    assert not len(problem_of(PERSON).loose_parts)
