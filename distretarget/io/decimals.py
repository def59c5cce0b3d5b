"""Rows of numbers as text with fixed numbers of decimals, made from the digits of all numbers at once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
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
