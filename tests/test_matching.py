"""Which joint drives which."""

import numpy as np
import pytest
from bodies import person

from distretarget import Skeleton
from distretarget.errors import MatchingError
from distretarget.matching import match


def renamed(skeleton, **names):
    return Skeleton(
        tuple(names.get(name, name) for name in skeleton.names),
        skeleton.parents,
        skeleton.offsets,
        skeleton.channels,
        skeleton.end_sites,
    )


def test_equal_names_match_in_any_order():
    body = person()
    np.testing.assert_array_equal(match(body, body), np.arange(len(body)))


def test_an_explicit_map_comes_before_equal_names():
    body = person()
    drivers = match(body, renamed(body, Hips="Pelvis"), {"Pelvis": "Hips", "LeftWrist": "LeftElbow"})
    assert drivers[0] == 0
    assert drivers[body.index("LeftWrist")] == body.index("LeftElbow")


def test_end_sites_follow_their_joint_whatever_they_are_called():
    body = person()
    drivers = match(body, renamed(body, Head="Skull", Head_End="Top"), {"Skull": "Head"})
    np.testing.assert_array_equal(drivers, np.arange(len(body)))


def test_an_end_site_without_counterpart_has_no_driver():
    body = person()
    bare = Skeleton(body.names[:22], body.parents[:22], body.offsets[:22], body.channels[:22], body.end_sites[:22])
    np.testing.assert_array_equal(match(bare, body)[22:], -1)


def test_missing_joints_are_named_with_what_is_near():
    body = person()
    with pytest.raises(MatchingError, match=r"no joint 'LeftWirst'; did you mean 'LeftWrist'") as caught:
        match(body, renamed(body, LeftWrist="LeftWirst"))
    assert caught.value.missing == ("LeftWirst",)
    with pytest.raises(MatchingError, match="no joint 'Nose'"):
        match(body, body, {"Head": "Nose"})
