"""Written files mean the same to other programs: joints are where this package has them."""

import pytest

from interop.judged import CASES, farthest, written
from interop.readers import READERS

CLOSE = 1e-4  # [heights of the body]


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.name)
def test_other_readers_find_joints_in_the_same_places(reader, case, tmp_path):
    if reason := reader.missing():
        pytest.skip(reason)
    assert farthest(reader, *written(case, tmp_path)) < CLOSE
