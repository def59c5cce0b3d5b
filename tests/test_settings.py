"""The settings of the contact objective: documented, checked, carried to workers, and obeyed."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from bodies import clapping, lengthened, person

from distretarget import Options, retarget
from distretarget.errors import SettingsError
from distretarget.objectives.activation import ContactSettings

DEFAULT = ContactSettings()
BONES_ALONE = Options(skin="none")


def test_settings_survive_pickling():
    changed = replace(DEFAULT, reach=0.1, blend=0.2)
    assert pickle.loads(pickle.dumps(changed)) == changed


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"blend": -0.1}, "blend is -0.1"),
        ({"reach": math.nan}, "reach is nan"),
        ({"foot_lock": math.inf}, "foot_lock is inf"),
        ({"strength": "much"}, "strength is 'much'"),
    ],
)
def test_values_without_meaning_are_refused_in_one_line(change, place):
    with pytest.raises(SettingsError, match=place) as refused:
        replace(DEFAULT, **change)
    assert "\n" not in str(refused.value)


def test_the_settings_given_are_those_that_count():
    source, body = clapping(np.ones(6)), lengthened(person(), {"Wrist": 1.5})
    nothing = retarget(source, body, BONES_ALONE, settings=replace(DEFAULT, strength=0.0, foot_lock=0.0))
    np.testing.assert_allclose(nothing.motion.world_rotations, nothing.rotation_copy.world_rotations, atol=1e-12)
    stiff, soft = (
        retarget(source, body, BONES_ALONE, settings=replace(DEFAULT, strength=strength)).metrics["result"][
            "contact_error"
        ]
        for strength in (2.0, 0.002)
    )
    assert stiff < 0.5 * soft


@pytest.mark.parametrize("blend", [0.1, 0.36])
def test_a_contact_sets_in_twice_the_blend_before_it(blend):
    """Until then the arms move as in the rotation copy. The hands meet in frame 100, and come near just before."""
    frame_time, meet = 0.02, 100
    source = clapping(np.clip((np.arange(150) - meet + 8) / 8, 0.0, 1.0), str(frame_time))
    settings = replace(DEFAULT, blend=blend, foot_lock=0.0)
    result = retarget(source, lengthened(person(), {"Wrist": 1.5}), BONES_ALONE, settings=settings)
    off = np.abs(result.motion.positions - result.rotation_copy.positions).max(axis=(1, 2)) > 1e-6
    assert np.argmax(off) * frame_time == pytest.approx(meet * frame_time - 2 * blend, abs=0.1)
