"""Springs: energy and gradient against a naive version."""

import numpy as np
import pytest
from spring_case import at, naive_energy, random_springs, stiffer_along

from distretarget.ik.articulation import Articulation, Scratch
from distretarget.ik.springs import FrameSprings, joined, spring_energy


def scratch_of(joints):
    """Scratch arrays for a body of so many joints."""
    root = np.array([-1] + [0] * (joints - 1))
    return Scratch.of(Articulation(root, np.zeros(joints, np.intp), np.ones(2)))


@pytest.mark.parametrize("seed", range(3))
def test_springs_have_the_energy_and_the_gradient_of_their_definition(seed):
    draw = np.random.default_rng(seed)
    scratch, springs = scratch_of(8), at(random_springs(draw, 8), 0)
    scratch.x[:] = draw.normal(size=(8, 3))
    scratch.gradient[:] = before = draw.normal(size=(8, 3))
    assert spring_energy(scratch, springs, len(springs.a)) == pytest.approx(naive_energy(scratch.x, springs))
    for i in np.ndindex(8, 3):
        step = np.zeros((8, 3))
        step[i] = 0.5
        slope = naive_energy(scratch.x + step, springs) - naive_energy(scratch.x - step, springs)
        assert scratch.gradient[i] - before[i] == pytest.approx(slope, abs=1e-9)


def test_a_spring_along_its_axis_does_not_feel_what_happens_across():
    scratch = scratch_of(2)
    axis, across = np.array([0.6, 0.8, 0.0]), np.array([0.8, -0.6, 2.0])
    A = stiffer_along(axis[None], np.array([4.0]), np.array([0.0]))
    springs = FrameSprings(np.array([0]), np.array([1]), np.zeros((1, 3)), A)
    scratch.x[0] = 0.5 * axis + across
    assert spring_energy(scratch, springs, len(springs.a)) == pytest.approx(0.5)
    np.testing.assert_allclose(scratch.gradient, [2 * axis, -2 * axis])


def test_only_the_first_springs_count():
    draw = np.random.default_rng(1)
    scratch, springs = scratch_of(8), at(random_springs(draw, 8), 0)
    scratch.x[:] = draw.normal(size=(8, 3))
    first = FrameSprings(*(values[:5] for values in springs))
    assert spring_energy(scratch, springs, 5) == pytest.approx(naive_energy(scratch.x, first))
    assert spring_energy(scratch, springs, 0) == 0


def test_joined_springs_are_those_of_both():
    draw = np.random.default_rng(0)
    one, other = (random_springs(draw, 8, frames=3, count=count) for count in (5, 9))
    both = joined(one, other)
    scratch = scratch_of(8)
    scratch.x[:] = draw.normal(size=(8, 3))
    for frame in range(3):
        energies = [spring_energy(scratch, at(springs, frame), len(springs.a)) for springs in (one, other, both)]
        assert energies[2] == pytest.approx(energies[0] + energies[1])
