"""The stiffness of parts: which give way to contacts and feet, and which do not."""

import numpy as np
from bodies import matched, person

from distretarget.distances import distance_problem
from distretarget.solve.poses import PoseProblem
from distretarget.solve.rigid_parts import part_of_joint
from distretarget.solve.settings import ContactSettings
from distretarget.solve.stiffness import part_stiffness

PERSON = person()
SETTINGS = ContactSettings()


def test_stiffness_grows_with_what_a_part_carries_and_feet_are_stiff():
    parts = part_of_joint(PERSON, np.arange(len(PERSON)))
    matching = matched(PERSON, PERSON)
    problem = PoseProblem(
        skeleton=PERSON,
        legs=matching.target.legs,
        unit=matching.target.unit,
        roots=np.arange(len(PERSON)),
        parts=parts,
        distances=distance_problem(PERSON, PERSON, matching.drivers),
        regions=matching.regions,
        source=PERSON.rest_positions[None],
        copy=PERSON.rest_positions[None],
        root=np.zeros((1, 3)),
        frame_time=1.0,
    )
    stiffness = part_stiffness(problem, SETTINGS)
    at = {name: stiffness[parts[PERSON.index(name)]] for name in PERSON.names}
    assert at["Hips"] > at["Chest"] > at["LeftShoulder"] > at["LeftElbow"] > at["LeftWrist"]
    assert at["LeftShoulder"] == at["RightShoulder"]
    assert stiffness[-1] == SETTINGS.root_stiffness
    assert at["Hips"] > 5 * at["LeftWrist"]
    assert at["LeftAnkle"] > at["LeftKnee"]
