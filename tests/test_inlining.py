"""Functions that become parts of others: what they return, and that no machine code is made of them."""

import gc

import numpy as np
import pytest
from numba import njit
from numba.core import event
from numba.core.codegen import JITCPUCodegen

from distretarget.ik import curvature as cholesky
from distretarget.numerics.compiled import inlined


@inlined()
def squared(x):
    return x * x


@inlined(fastmath=True)
def sum_of_squares(values):
    total = 0.0
    for value in values:
        total += squared(value)
    return total


@pytest.fixture
def outer():
    """A compiled function with parts, which is compiled anew for each test."""
    return njit(error_model="numpy")(lambda values: np.sqrt(sum_of_squares(values)))


def test_parts_return_what_python_does(outer):
    assert outer(np.array([3.0, 4.0])) == np.sqrt(sum_of_squares(np.array([3.0, 4.0]))) == 5.0
    assert outer(np.array([3, 4, 12])) == 13.0


def test_machine_code_is_made_of_the_whole_alone(outer, monkeypatch):
    made, add = [], JITCPUCodegen._add_module
    monkeypatch.setattr(
        JITCPUCodegen, "_add_module", lambda self, module: made.append(module.name) or add(self, module)
    )
    outer(np.ones((2, 2))[0])
    assert len(made) == 1


class Watch(event.Listener):
    """Notes whether garbage is collected when a compilation starts."""

    def __init__(self):
        self.collecting = set()

    def on_start(self, event):  # noqa: ARG002
        self.collecting.add(gc.isenabled())

    def on_end(self, event):
        pass


@pytest.mark.parametrize("collecting", [True, False])
def test_no_garbage_is_collected_while_a_function_compiles_and_then_as_before(collecting):
    H, watch = np.eye(3), Watch()
    try:
        (gc.enable if collecting else gc.disable)()
        with event.install_listener("numba:compile", watch):
            njit(error_model="numpy")(cholesky.factorise)(H, 3)
        assert watch.collecting == {False}
        assert gc.isenabled() == collecting
    finally:
        gc.enable()


def test_compiling_functions_of_others_leaves_garbage_collection_alone():
    watch = Watch()
    with event.install_listener("numba:compile", watch):
        njit(lambda x: x + 1)(1)
    assert watch.collecting == {True}
