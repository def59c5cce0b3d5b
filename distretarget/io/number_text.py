"""Convert tables of numbers, as in BVH files, to text and back, exact to the last digit. Compiled."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.vectors import F1, F2, I1, L1, Array, Letters

MOST_DIGITS = 18  # of a number that is read: these always fit an integer of 64 bits
EXACT = 2**53  # all integers up to it are doubles
POWERS = np.array([float(10**n) for n in range(23)])  # the powers of ten that are exact as doubles
ZERO, PLUS, MINUS, POINT, SMALL_E, LARGE_E, SPACE, TAB, RETURN = b"0+-.eE \t\r"
MOST_DECIMALS = 18  # of a number that is written: these fit an integer of 64 bits
LARGEST_SCALED = 2.0**50  # limit of number times 10^decimals; larger ones have too few bits left for rounding
SCALING_ERROR = 2.0**-52  # relative error of that product
SPLIT = 2.0**27 + 1.0  # Dekker's constant: splits a double into two halves
TEN, HUNDRED = np.uint64(10), np.uint64(100)
PAIRS = np.array([ord(digit) for number in range(100) for digit in f"{number:02}"], np.uint8)
LONGEST_NUMBER = 22  # characters: sign, digits, point, and the blank after the number
NEWLINE = ord("\n")


def parse_numbers(text: bytes) -> Array | None:
    """Return the numbers of a text, separated by blanks, as the nearest doubles; None if one is not finite."""
    numbers = np.empty(len(text) // 2 + 1)
    whole = text if text[-1:].isspace() else text + b"\n"
    end = np.zeros(1, np.intp)
    count = _leading_numbers(np.frombuffer(whole, np.uint8), POWERS, numbers, end)
    leading, rest = numbers[:count], text[end[0] :]
    if not rest:
        return leading
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)
            others = np.fromstring(rest, sep=" ")
    except (ValueError, DeprecationWarning):
        return None
    blank = np.isin(np.frombuffer(b" " + rest, np.uint8), list(b" \t\n\v\f\r"))
    words = np.count_nonzero(blank[:-1] > blank[1:])
    return np.concatenate([leading, others]) if others.size == words and np.isfinite(others).all() else None


@compiled()
def _leading_numbers(text: L1, powers: F1, numbers: Out[F1], end: Out[I1]) -> int:
    """Write the numbers at the beginning of a text, which ends with a blank, to `numbers`, and the position where they
    end to `end`; return their count.

    They end at the first word that is not a number, or whose digits or power of ten are not exact as doubles. If both
    are, one multiplication or division gives the nearest double (W. D. Clinger, How to read floating point numbers
    accurately, 1990).
    """
    count, at = 0, 0
    while True:
        while at < len(text) and _is_blank(text[at]):
            at += 1
        begin = at
        if at == len(text):
            end[0] = at
            return count
        negative = text[at] == MINUS
        at += negative or text[at] == PLUS
        first = at
        whole, at = _digits(text, first, 0)
        digits, power = at - first, 0
        if text[at] == POINT:
            first = at + 1
            whole, at = _digits(text, first, whole)
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
            end[0] = begin
            return count
        value = whole * powers[power] if power >= 0 else whole / powers[-power]
        numbers[count] = -value if negative else value
        count += 1


@inlined()
def _digits(text: Letters, at: int, whole: int) -> tuple[int, int]:
    """Append the digits at a position of a text to a whole number; return it and the position behind them."""
    digit = _digit(text[at])
    while 0 <= digit <= 9:
        whole, at = 10 * whole + digit, at + 1
        digit = _digit(text[at])
    return whole, at


@inlined()
def _digit(letter: int) -> int:
    """The value of a digit; outside 0 to 9 for other characters. In 64 bits, since bytes would overflow."""
    return np.int64(letter) - ZERO  # type: ignore[return-value]


@inlined()
def _is_blank(letter: int) -> bool:
    return letter == SPACE or TAB <= letter <= RETURN


def rows_text(values: Array, decimals: Sequence[int]) -> str:
    """Return the text of finite values (rows, columns): a line for each row, with spaces between the columns.

    `decimals` is how many digits follow the point in each column, at least 1. The text is that of the operator `%`,
    character by character.
    """
    text = np.empty(values.size * LONGEST_NUMBER, np.uint8)
    short = values.size and max(decimals) <= MOST_DECIMALS
    scales, places = np.array([10.0**n for n in decimals]), np.array(decimals, np.intp)
    begin = _write_rows(np.ascontiguousarray(values), scales, places, PAIRS, text) if short else -1
    if begin < 0:
        line = " ".join(f"%.{places}f" for places in decimals)
        return "".join(f"{line % tuple(row)}\n" for row in values.tolist())
    return text[begin:].tobytes().decode("ascii")


@compiled()
def _write_rows(values: F2, scales: F1, decimals: I1, pairs: L1, text: Out[L1]) -> int:
    """Write numbers as decimals to `text`, from its end backwards; return where the text begins, -1 if a number is too
    large. `pairs` has the two digits of each number below 100.
    """
    at, columns = len(text), len(decimals)
    for row in range(len(values) - 1, -1, -1):
        for column in range(columns - 1, -1, -1):
            size = abs(values[row, column])
            if not size * scales[column] < LARGEST_SCALED:
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
def _write_digit(number: np.uint64, text: Letters, at: int) -> int:
    """Write the last digit of a number before a position; return the digit's position."""
    text[at - 1] = ZERO + np.int64(number % TEN)
    return at - 1


@inlined()
def _write_pair(number: np.uint64, pairs: Letters, text: Letters, at: int) -> int:
    """Write the last two digits of a number before a position; return the position of the first."""
    pair = 2 * np.int64(number % HUNDRED)
    text[at - 2], text[at - 1] = pairs[pair], pairs[pair + 1]
    return at - 2


@inlined()
def _rounded(size: float, scale: float) -> int:
    """The exact product of a positive number and a power of ten, rounded to a whole number, halves to even.

    If rounding of the product may have moved it across a half, its exact error decides (T. J. Dekker, A floating-point
    technique for extending the available precision, 1971).
    """
    scaled = size * scale
    whole = np.rint(scaled)
    if abs(scaled - whole) < 0.5 - SCALING_ERROR * scaled:
        return int(whole)
    a, b = SPLIT * size, SPLIT * scale
    a, b = a - (a - size), b - (b - scale)
    error = (size - a) * (scale - b) - (((scaled - a * b) - (size - a) * b) - a * (scale - b))
    whole = np.floor(scaled)
    above = (scaled - whole - 0.5) + error
    return int(whole) + int(above > 0.0 or (above == 0.0 and whole % 2.0 == 1.0))
