"""The stiffness of parts: what gives way to contacts and feet, and what does not."""

import numpy as np
from bodies import person

from distretarget.solve.rigid_parts import part_of_joint
from distretarget.solve.settings import ContactSettings
from distretarget.solve.stiffness import part_stiffness

PERSON = person()
SETTINGS = ContactSettings()


def test_stiffness_grows_with_what_a_part_carries_and_feet_are_stiff():
    parts = part_of_joint(PERSON, np.arange(len(PERSON)))
    stiffness = part_stiffness(PERSON, parts, np.arange(len(PERSON)), 2 * 0.888, SETTINGS)
    at = {name: stiffness[parts[PERSON.index(name)]] for name in PERSON.names}
    assert at["Hips"] > at["Chest"] > at["LeftShoulder"] > at["LeftElbow"] > at["LeftWrist"]
    assert at["LeftShoulder"] == at["RightShoulder"]
    assert stiffness[-1] == SETTINGS.root_stiffness
    assert at["Hips"] > 5 * at["LeftWrist"]
    assert at["LeftAnkle"] > at["LeftKnee"]
