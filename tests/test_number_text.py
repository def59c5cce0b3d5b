"""Numbers of a text are the nearest doubles, as Python reads them, and their text is what the operator % makes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from distretarget.io.number_text import parse_numbers, rows_text

WORDS = st.one_of(
    st.from_regex(r"[+-]?([0-9]{1,20}\.?[0-9]{0,20}|\.[0-9]{1,9})([eE][+-]?[0-9]{1,2})?", fullmatch=True),
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.integers(-(2**60), 2**60).map(str),
)
BLANKS = st.text(" \t\n\v\f\r", min_size=1, max_size=3)


@given(st.lists(st.tuples(WORDS, BLANKS)), BLANKS)
def test_numbers_are_those_that_python_reads(words, first):
    text = first + "".join(word + blank for word, blank in words)
    numbers = parse_numbers(text.encode())
    assert numbers is not None
    expected = np.array([float(word) for word, _ in words])
    np.testing.assert_array_equal(numbers, expected)
    np.testing.assert_array_equal(np.signbit(numbers), np.signbit(expected))


UNFINISHED = ["-", "+", ".", "1e", "1e+", "e5", "--1", "1-2", "1.2.3"]
STRANGE = ["x", "1_0", "0x10", "nan", "-inf", "1e400", "1}", "1\x00", "é"]


@pytest.mark.parametrize("before", ["", "1 2.5 ", "1 0.12345678901234567890 "])
@pytest.mark.parametrize("word", [*UNFINISHED, *STRANGE])
def test_a_word_that_is_no_finite_number_is_refused(before, word):
    for after in ("", " 3"):
        assert parse_numbers((before + word + after).encode()) is None


def test_the_end_of_the_text_ends_a_number():
    for text, expected in (("", []), (" \n", []), ("1", [1.0]), ("1 -2.", [1.0, -2.0])):
        assert parse_numbers(text.encode()).tolist() == expected


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
