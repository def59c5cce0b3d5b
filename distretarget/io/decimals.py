"""Decimal numbers as text, by compiled code: many read at once, and rows written with fixed numbers of decimals."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import compiled, inlined

Array = NDArray[np.float64]

MOST_DIGITS = 18  # that always fit an integer of 64 bits
EXACT = 2**53  # up to it all integers are doubles
POWERS = np.array([float(10**n) for n in range(23)])  # all powers of ten that are doubles
BLANKS = b" \t\n\v\f\r"
ZERO, NINE, PLUS, MINUS, POINT, SMALL_E, LARGE_E, SPACE, TAB, NEWLINE, RETURN = b"09+-.eE \t\n\r"


def parse_numbers(text: bytes) -> Array | None:
    """Return the numbers of a text, separated by blanks, as the nearest doubles; None if one is not finite."""
    numbers = np.empty(len(text) // 2 + 1)
    count, at = _leading_numbers(np.frombuffer(text + b"\n", np.uint8), POWERS, numbers)
    leading, rest = numbers[:count], text[at:]
    if not rest:
        return leading
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)
            others = np.fromstring(rest, sep=" ")
    except (ValueError, DeprecationWarning):
        return None
    blank = np.isin(np.frombuffer(b" " + rest, np.uint8), list(BLANKS))
    words = np.count_nonzero(blank[:-1] > blank[1:])
    return np.concatenate([leading, others]) if others.size == words and np.isfinite(others).all() else None


@compiled()
def _leading_numbers(text: NDArray[np.uint8], powers: Array, numbers: Array) -> tuple[int, int]:
    """Write the first numbers of a text, which ends with a blank, to `numbers`; return their count and where they end.

    They end at the first word that is not a number or has too many digits. For the others one multiplication or
    division of two exact doubles, the digits as an integer and a power of ten, gives the nearest double (W. D. Clinger,
    How to read floating point numbers accurately, 1990).
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
    """The value of a digit, in 64 bits, since bytes would overflow without numba."""
    return np.int64(letter) - ZERO  # type: ignore[return-value]


@inlined()
def _is_blank(letter: int) -> bool:
    return letter == SPACE or TAB <= letter <= RETURN


MOST_DECIMALS = 18  # that fit an integer of 64 bits
LARGEST = 2.0**50  # of a scaled number; larger ones have too few bits left to round them
DOUBT = 2.0**-52  # relative error of a scaled number
LONGEST = 22  # characters of a number: sign, digits, point, and the blank after it


def rows_text(values: Array, decimals: Sequence[int]) -> str:
    """Return the text of finite values (rows, columns): a line for each row, with spaces between the columns.

    `decimals` is how many digits follow the point in each column, at least 1. The text is that of the operator `%`,
    character by character.
    """
    if not _are_short(values, decimals):
        line = " ".join(f"%.{places}f" for places in decimals)
        return "".join(f"{line % tuple(row)}\n" for row in values.tolist())
    text = np.empty(values.size * LONGEST, np.uint8)
    begin = _write_rows(_rounded(values, decimals), np.signbit(values), np.array(decimals, np.int64), text)
    return text[begin:].tobytes().decode("ascii")


def _are_short(values: Array, decimals: Sequence[int]) -> bool:
    """Whether there are values, and all of them, scaled to integers, are exact."""
    if not values.size or max(decimals) > MOST_DECIMALS:
        return False
    return bool((np.abs(values) < [LARGEST / 10**places for places in decimals]).all())


def _rounded(values: Array, decimals: Sequence[int]) -> NDArray[np.int64]:
    """The absolute values scaled to integers; `%` decides values near a half, which scaling may push across it."""
    scaled = np.abs(values) * [float(10**places) for places in decimals]
    rounded = np.rint(scaled)
    for row, column in np.argwhere(np.abs(scaled - rounded) >= 0.5 - DOUBT * scaled):
        rounded[row, column] = float(f"{abs(values[row, column]):.{decimals[column]}f}".replace(".", ""))
    return np.asarray(rounded, np.int64)


@compiled()
def _write_rows(
    numbers: NDArray[np.int64], negative: NDArray[np.bool_], decimals: NDArray[np.int64], text: NDArray[np.uint8]
) -> int:
    """Write scaled integers as decimals to the end of `text`, last digit first; return where the text begins."""
    at, columns = len(text), len(decimals)
    for row in range(len(numbers) - 1, -1, -1):
        for column in range(columns - 1, -1, -1):
            at -= 1
            text[at] = SPACE if column < columns - 1 else NEWLINE
            rest, digits = numbers[row, column], 0
            while rest > 0 or digits <= decimals[column]:
                if digits == decimals[column]:
                    at -= 1
                    text[at] = POINT
                at -= 1
                text[at] = ZERO + rest % 10
                rest //= 10
                digits += 1
            if negative[row, column]:
                at -= 1
                text[at] = MINUS
    return at
