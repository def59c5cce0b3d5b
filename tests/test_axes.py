"""Which way a body points, and the axes of a file."""

import itertools
import sys
from pathlib import Path

import numpy as np
import pytest
from bodies import WAYS, person, turned

sys.path.append(str(Path(__file__).resolve().parents[1] / "tools"))
from make_rigs import CONVENTIONS, rig

PEOPLE = [person(), *(rig(convention, pose) for convention, pose in itertools.product(CONVENTIONS, "TA"))]

ways = pytest.mark.parametrize("way", WAYS, ids=[f"way{k}" for k in range(len(WAYS))])


@ways
def test_the_axes_of_a_body_turn_with_it(way):
    for body in PEOPLE[:3]:
        anatomy = by_names(body)
        axes, there = (body_axes(anatomy, b.rest_positions) for b in (body, turned(body, way)))
        np.testing.assert_allclose(there, way.as_matrix() @ axes, atol=1e-12)
        np.testing.assert_allclose(axes[:, 0], [1, 0, 0], atol=1e-6)
        assert axes[1, 1] > 0.98
        assert axes[2, 2] > 0.98
