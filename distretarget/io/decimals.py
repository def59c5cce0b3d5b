"""Decimal numbers as text, by compiled code: many read at once, and rows written with fixed numbers of decimals."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import compiled, inlined, runs_as_python

Array = NDArray[np.float64]

MOST_DIGITS = 18  # that always fit an integer of 64 bits
EXACT = 2**53  # up to it all integers are doubles
POWERS = np.array([float(10**n) for n in range(23)])  # all powers of ten that are doubles
BLANKS = b" \t\n\v\f\r"
ZERO, PLUS, MINUS, POINT, SMALL_E, LARGE_E, SPACE, TAB, NEWLINE, RETURN = b"0+-.eE \t\n\r"


def parse_numbers(text: bytes) -> Array | None:
    """Return the numbers of a text, separated by blanks, as the nearest doubles; None if one is not finite."""
    numbers = np.empty(len(text) // 2 + 1)
    whole = text if text[-1:].isspace() else text + b"\n"
    count, at = 0, 0
    if not runs_as_python(len(text) // 8):  # numpy reads a few sooner
        count, at = _leading_numbers(np.frombuffer(whole, np.uint8), POWERS, numbers)
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
        first, whole, digit = at, 0, _digit(text[at])
        while 0 <= digit <= 9:
            whole, at = 10 * whole + digit, at + 1
            digit = _digit(text[at])
        digits, power = at - first, 0
        if text[at] == POINT:
            at += 1
            first, digit = at, _digit(text[at])
            while 0 <= digit <= 9:
                whole, at = 10 * whole + digit, at + 1
                digit = _digit(text[at])
            digits, power = digits + at - first, first - at
        if text[at] == SMALL_E or text[at] == LARGE_E:
            at += 1
            down = text[at] == MINUS
            at += down or text[at] == PLUS
            exponent, first = 0, at
            while 0 <= _digit(text[at]) <= 9 and at < first + 3:
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
def _digit(letter: int) -> int:
    """The value of a digit, other letters have none from 0 to 9; in 64 bits, since bytes would overflow."""
    return np.int64(letter) - ZERO  # type: ignore[return-value]


@inlined()
def _is_blank(letter: int) -> bool:
    return letter == SPACE or TAB <= letter <= RETURN


MOST_DECIMALS = 18  # that fit an integer of 64 bits
LARGEST = 2.0**50  # of a scaled number; larger ones have too few bits left to round them
DOUBT = 2.0**-52  # relative error of a scaled number
SPLIT = 2.0**27 + 1.0  # halves the digits of a number
TEN, HUNDRED = np.uint64(10), np.uint64(100)
PAIRS = np.array([ord(digit) for number in range(100) for digit in f"{number:02}"], np.uint8)
LONGEST = 22  # characters of a number: sign, digits, point, and the blank after it


def rows_text(values: Array, decimals: Sequence[int]) -> str:
    """Return the text of finite values (rows, columns): a line for each row, with spaces between the columns.

    `decimals` is how many digits follow the point in each column, at least 1. The text is that of the operator `%`,
    character by character.
    """
    text = np.empty(values.size * LONGEST, np.uint8)
    short = values.size and max(decimals) <= MOST_DECIMALS
    scales, places = np.array([10.0**n for n in decimals]), np.array(decimals, np.int64)
    begin = _write_rows(np.ascontiguousarray(values), scales, places, PAIRS, text) if short else -1
    if begin < 0:
        line = " ".join(f"%.{places}f" for places in decimals)
        return "".join(f"{line % tuple(row)}\n" for row in values.tolist())
    return text[begin:].tobytes().decode("ascii")


@compiled()
def _write_rows(
    values: Array, scales: Array, decimals: NDArray[np.int64], pairs: NDArray[np.uint8], text: NDArray[np.uint8]
) -> int:
    """Write numbers as decimals to the end of `text`, last digit first; return where the text begins, -1 if one is too
    large. `pairs` are the two digits of each number below 100.
    """
    at, columns = len(text), len(decimals)
    for row in range(len(values) - 1, -1, -1):
        for column in range(columns - 1, -1, -1):
            size = abs(values[row, column])
            if not size * scales[column] < LARGEST:
                return -1
            at -= 1
            text[at] = SPACE if column < columns - 1 else NEWLINE
            rest, left = np.uint64(_rounded(size, scales[column])), decimals[column]
            for _ in range(left // 2):
                at = _write_pair(rest, pairs, text, at)
                rest //= HUNDRED
            if left % 2:
                at = _write_digit(rest, text, at)
                rest //= TEN
            at -= 1
            text[at] = POINT
            while rest >= TEN:
                at = _write_pair(rest, pairs, text, at)
                rest //= HUNDRED
            if rest > 0 or text[at] == POINT:
                at = _write_digit(rest, text, at)
            if np.signbit(values[row, column]):
                at -= 1
                text[at] = MINUS
    return at


@inlined()
def _write_digit(number: np.uint64, text: NDArray[np.uint8], at: int) -> int:
    """Write the last digit of a number before a place; return the digit's."""
    text[at - 1] = ZERO + np.int64(number % TEN)
    return at - 1


@inlined()
def _write_pair(number: np.uint64, pairs: NDArray[np.uint8], text: NDArray[np.uint8], at: int) -> int:
    """The same of the last two digits."""
    pair = 2 * np.int64(number % HUNDRED)
    text[at - 2], text[at - 1] = pairs[pair], pairs[pair + 1]
    return at - 2


@inlined()
def _rounded(size: float, scale: float) -> int:
    """The product of a positive number and a power of ten, rounded to a whole number; of two equally near ones, to the
    even one.

    Where scaling may have pushed it across a half, the error of the product decides, which is exact (T. J. Dekker, A
    floating-point technique for extending the available precision, 1971).
    """
    scaled = size * scale
    whole = np.rint(scaled)
    if abs(scaled - whole) < 0.5 - DOUBT * scaled:
        return int(whole)
    a, b = SPLIT * size, SPLIT * scale
    a, b = a - (a - size), b - (b - scale)
    error = (size - a) * (scale - b) - (((scaled - a * b) - (size - a) * b) - a * (scale - b))
    whole = np.floor(scaled)
    above = (scaled - whole - 0.5) + error
    return int(whole) + int(above > 0.0 or (above == 0.0 and whole % 2.0 == 1.0))
