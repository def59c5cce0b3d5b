"""OBJ files: points of props."""

import numpy as np
import pytest
from bvh_texts import format_bvh

from distretarget import BvhError
from distretarget.io.bvh import parse_bvh
from distretarget.io.obj import MOST_POINTS, parse_obj, parse_obj_mesh

CUBE = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (1, 2) for z in (-1, 0)) + "f 1 2 3\n"


def test_a_prop_has_the_points_of_its_file():
    motion = parse_obj(f"# a cube\r\n{CUBE}vn 0 1 0\n", "cube.obj")
    assert motion.skeleton.names[0] == "cube"
    points = motion.positions[0]
    expected = [[x, y, z] for x in (0, 1) for y in (1, 2) for z in (-1, 0)]
    np.testing.assert_allclose(sorted(points.tolist()), expected)
    assert motion.skeleton.lengths[1:].max() == 1.0


def test_a_prop_survives_a_bvh_file():
    motion = parse_obj(CUBE, "cube.obj")
    back = parse_bvh(format_bvh(motion), "cube.bvh")
    np.testing.assert_allclose(sorted(back.positions[0].tolist()), sorted(motion.positions[0].tolist()), atol=1e-6)


def test_many_points_are_thinned():
    text = "".join(f"v {x} 0 0\n" for x in np.linspace(0, 1, 1001))
    kept = np.sort(parse_obj(text, "line.obj").positions[0, :, 0])
    assert len(kept) == MOST_POINTS
    assert np.diff(kept).max() < 3.0 / MOST_POINTS


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("f 1 2 3\n", 0, "has no vertices"),
        ("v 1 2\n", 1, "found '1 2', expected three"),
        ("v 0 0 0\nv 1 x 2\n", 2, "found '1 x 2'"),
        ("v 1 nan 2\n", 1, "finite"),
        ("v 1_0 0 0\n", 1, "found '1_0 0 0', expected three"),
        ("v 1 ٣ 2\n", 1, "expected three finite"),
    ],
)
def test_what_is_no_obj_is_refused(text, line, words):
    with pytest.raises(BvhError, match=words) as caught:
        parse_obj(text, "prop.obj")
    assert caught.value.line == line


@pytest.mark.parametrize("corner", ["1_0", "٣", "x", "1.5", "0", "4", "9" * 5000])
def test_corners_that_are_no_vertices_above_are_refused(corner):
    with pytest.raises(BvhError, match="expected the number of one of the 3 vertices above"):
        parse_obj_mesh(f"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1/1 -2 {corner}\n", "prop.obj")
