"""Numbers of a text: the nearest doubles, as Python reads them, and nothing that is no number."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from distretarget.io.number_text import parse_numbers

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


@pytest.mark.parametrize("before", ["", "1 2.5 ", "1 0.12345678901234567890 "])
@pytest.mark.parametrize(
    "word",
    [
        "x",
        "-",
        "+",
        ".",
        "1.2.3",
        "--1",
        "1-2",
        "1e",
        "1e+",
        "e5",
        "1_0",
        "0x10",
        "nan",
        "-inf",
        "1e400",
        "1}",
        "1\0",
        "é",
    ],
)
def test_a_word_that_is_no_finite_number_is_refused(before, word):
    for after in ("", " 3"):
        assert parse_numbers((before + word + after).encode()) is None


def test_the_end_of_the_text_ends_a_number():
    for text, expected in (("", []), (" \n", []), ("1", [1.0]), ("1 -2.", [1.0, -2.0])):
        assert parse_numbers(text.encode()).tolist() == expected
