"""Decimal numbers as text: many read at once by compiled code, and rows written with fixed numbers of decimals."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence

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


Integers = NDArray[np.int64]
Words = NDArray[np.uint32]

MOST_DECIMALS = 18  # that an integer of 64 bits can hold
LARGEST = 2.0**50  # of a scaled number; larger ones have too few bits left to tell how they are rounded
DOUBT = 2.0**-52  # a scaled number is off by less than this part of it
BLANK = b"\0"  # fills texts up to 4 bytes, and is deleted in the end


def rows_text(values: Array, decimals: Sequence[int]) -> str:
    """Return the text of finite values (rows, columns): a line for each row, with spaces between the columns.

    `decimals` is how many digits follow the point in each column, at least 1. The text is that of the operator `%`,
    character by character.
    """
    if not _are_short(values, decimals):
        line = " ".join(f"%.{places}f" for places in decimals)
        return "".join(f"{line % tuple(row)}\n" for row in values.tolist())
    whole, fraction = np.divmod(_rounded(values, decimals), [10**places for places in decimals])
    ends = [" "] * (len(decimals) - 1) + ["\n"]
    words = [
        _words(["", "-"])[np.signbit(values).astype(np.intp)],
        *reversed(list(_whole_words(whole))),
        *_fraction_words(fraction, np.array(decimals, np.int64)),
        _words(ends),
    ]
    text = np.stack(np.broadcast_arrays(*words), axis=-1)
    return text.tobytes().translate(None, BLANK).decode("ascii")


def _are_short(values: Array, decimals: Sequence[int]) -> bool:
    """Whether there are values and all of them, without their points, are integers that can be told exactly."""
    if not values.size or max(decimals) > MOST_DECIMALS:
        return False
    return bool((np.abs(values) < [LARGEST / 10**places for places in decimals]).all())


def _rounded(values: Array, decimals: Sequence[int]) -> Integers:
    """The values without their points, as integers.

    Near the middle between two integers, where scaling may have led to the wrong side, the operator `%` decides.
    """
    scaled = np.abs(values) * [float(10**places) for places in decimals]
    rounded = np.rint(scaled)
    for row, column in np.argwhere(np.abs(scaled - rounded) >= 0.5 - DOUBT * scaled):
        rounded[row, column] = float(f"{abs(values[row, column]):.{decimals[column]}f}".replace(".", ""))
    return np.asarray(rounded, np.int64)


def _whole_words(whole: Integers) -> Iterator[Words]:
    """The digits before the point in groups of three, from the last, which has the point, to the first."""
    table = LAST_GROUP
    while whole.any() or table is LAST_GROUP:
        whole, group = np.divmod(whole, 1000)
        yield table[group + 1000 * (whole > 0)]
        table = GROUP


def _fraction_words(fraction: Integers, decimals: Integers) -> Iterator[Words]:
    """The digits after the point in groups of three, from the first to the last."""
    groups = -(-int(decimals.max()) // 3)
    aligned = fraction * 10 ** (3 * groups - decimals)
    for group in range(groups):
        number = aligned // 1000 ** (groups - 1 - group) % 1000
        yield DECIMALS[number + 1000 * np.clip(decimals - 3 * group, 0, 3)]


def _words(texts: Iterable[str]) -> Words:
    """Texts of up to 4 characters, each as the bytes of an integer."""
    return np.frombuffer(b"".join(text.encode().ljust(4, BLANK) for text in texts), np.uint32)


PADDED = [f"{number:03}" for number in range(1000)]
GROUP = _words(["", *(str(number) for number in range(1, 1000)), *PADDED])
"""A group of digits before the point: alone or first, and from 1000 on, after another group."""
LAST_GROUP = _words([*(f"{number}." for number in range(1000)), *(f"{digits}." for digits in PADDED)])
"""The same of the group that ends at the point."""
DECIMALS = _words(digits[:kept] for kept in range(4) for digits in PADDED)
"""A group of digits after the point; from 1000 times n on, the first n of them."""
