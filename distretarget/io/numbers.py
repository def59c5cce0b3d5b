"""Many decimal numbers in a text, read fast by compiled code where that gives the nearest doubles, else by numpy."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import compiled, inlined

Bytes = NDArray[np.uint8]
Array = NDArray[np.float64]

MOST_DIGITS = 18  # of an integer of 64 bits, whatever they are
EXACT = 2**53  # up to it all integers are doubles
POWERS = np.array([float(10**n) for n in range(23)])  # all powers of ten that are doubles
BLANKS = b" \t\n\v\f\r"
ZERO, NINE, PLUS, MINUS, POINT, SMALL_E, LARGE_E, SPACE, TAB, RETURN = b"09+-.eE \t\r"


def parse_numbers(text: bytes) -> Array | None:
    """Return all numbers of a text, (numbers,), each the double nearest to its decimals.

    Numbers are separated by blanks. None if a word is not a finite number.
    """
    padded = np.frombuffer(text + b"\n", np.uint8)
    numbers = np.empty(len(text) // 2 + 1)
    count, at = _leading_numbers(padded, POWERS, numbers)
    leading, rest = numbers[:count], text[at:]
    if not rest:
        return leading
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)
            others = np.fromstring(rest, sep=" ")
    except (ValueError, DeprecationWarning):
        return None
    sound = others.size == _word_count(rest) and np.all(np.isfinite(others))
    return np.concatenate([leading, others]) if sound else None


def _word_count(text: bytes) -> int:
    blank = np.isin(np.frombuffer(b" " + text, np.uint8), list(BLANKS))
    return int(np.count_nonzero(blank[:-1] > blank[1:]))


@compiled()
def _leading_numbers(text: Bytes, powers: Array, numbers: Array) -> tuple[int, int]:
    """Write the numbers that a text begins with; return how many there are, and where the rest begins.

    The text must end with a blank. The rest begins with the first word that is not a number, or not exactly the product
    or quotient of two integers that are doubles: the whole number of its digits, and a power of ten. The double nearest
    to such a product is found by one operation (W. D. Clinger, How to read floating point numbers accurately, 1990).
    """
    count, at = 0, 0
    while True:
        while at < len(text) and _is_blank(text[at]):
            at += 1
        begin = at
        if at == len(text):
            return count, at
        negative = text[at] == MINUS
        at += negative or text[at] == PLUS
        first, whole = at, 0
        while _is_digit(text[at]):
            whole = 10 * whole + _digit(text[at])
            at += 1
        digits, power = at - first, 0
        if text[at] == POINT:
            at += 1
            first = at
            while _is_digit(text[at]):
                whole = 10 * whole + _digit(text[at])
                at += 1
            digits, power = digits + at - first, first - at
        if text[at] == SMALL_E or text[at] == LARGE_E:
            at += 1
            down = text[at] == MINUS
            at += down or text[at] == PLUS
            exponent, first = 0, at
            while _is_digit(text[at]) and at < first + 3:
                exponent = 10 * exponent + _digit(text[at])
                at += 1
            power += -exponent if down else exponent
            digits = digits if at > first else 0
        exact = 0 < digits <= MOST_DIGITS and whole <= EXACT and abs(power) < len(powers)
        if not exact or not _is_blank(text[at]):
            return count, begin
        value = whole * powers[power] if power >= 0 else whole / powers[-power]
        numbers[count] = -value if negative else value
        count += 1


@inlined()
def _is_digit(letter: int) -> bool:
    return ZERO <= letter <= NINE


@inlined()
def _digit(letter: int) -> int:
    """The number of a digit, in 64 bits: where numba is switched off, bytes would overflow."""
    return np.int64(letter) - ZERO  # type: ignore[return-value]


@inlined()
def _is_blank(letter: int) -> bool:
    return letter == SPACE or TAB <= letter <= RETURN
