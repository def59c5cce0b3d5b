"""Numbers as text: character by character what the operator % makes of them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from distretarget.io.number_text import rows_text


def by_operator(values, decimals):
    line = " ".join(f"%.{places}f" for places in decimals)
    return "".join(f"{line % tuple(row)}\n" for row in values.tolist())


numbers = st.one_of(
    st.floats(-1e4, 1e4),
    st.floats(allow_nan=False, allow_infinity=False),
    st.integers(-(10**12), 10**12).map(lambda number: number / 2e6),  # half of the last digit, if 6 are written
    st.integers(-(10**9), 10**9).map(float),
)


@given(st.data())
def test_the_text_is_that_of_the_operator(data):
    decimals = data.draw(st.lists(st.integers(1, 20), min_size=1, max_size=4))
    values = data.draw(arrays(float, (data.draw(st.integers(0, 4)), len(decimals)), elements=numbers))
    assert rows_text(values, decimals) == by_operator(values, decimals)


@pytest.mark.parametrize("neighbour", [-np.inf, 0, np.inf])
def test_numbers_beside_the_middle_between_two_texts(neighbour):
    """Scaled by a power of ten, many of them are on the other side of it."""
    halves = (np.arange(-9999, 9999, 2) * 10.0 ** np.arange(0, 8)[:, None] + 1).ravel() / 2e6
    values = halves if neighbour == 0 else np.nextafter(halves, neighbour)
    assert rows_text(values[:, None], [6]) == by_operator(values[:, None], [6])


def test_every_number_of_digits():
    powers = 10.0 ** np.arange(-8, 12)
    values = np.concatenate([powers, powers - 1, -powers])[:, None]
    for places in range(1, 12):
        assert rows_text(values, [places]) == by_operator(values, [places])


def test_rows_without_columns_are_empty_lines():
    assert rows_text(np.zeros((2, 0)), []) == "\n\n"
