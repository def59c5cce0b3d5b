"""The text of BVH files: its words, names and numbers, each checked; many numbers at once, by compiled code."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import BvhError, cut
from distretarget.numerics.compiled import compiled, inlined, runs_as_python
from distretarget.numerics.vectors import Array
from distretarget.skeleton import LARGEST

WORD = re.compile(r"[{}]|[^\s{}]+", re.ASCII)
NAME = re.compile(r"[^{}\r\n\0]*")
LINE_END = re.compile(r"\r\n|\r|\n")
NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
COUNT = re.compile(r"\d{1,18}", re.ASCII)
BLANKS = " \t\v\f"
MOST_DIGITS = 18  # that always fit an integer of 64 bits
EXACT = 2**53  # up to it all integers are doubles
POWERS = np.array([float(10**n) for n in range(23)])  # all powers of ten that are doubles
ZERO, PLUS, MINUS, POINT, SMALL_E, LARGE_E, SPACE, TAB, RETURN = b"0+-.eE \t\r"


class Words:
    """Reads a text word by word. A brace is a word of its own; at the end of the text words are empty."""

    def __init__(self, path: str | Path, text: str) -> None:
        self.path, self.text = path, text
        self.at = 0  # the position up to which it has been read
        self._word_at = 0

    def take(self) -> str:
        """The next word."""
        found = WORD.search(self.text, self.at)
        self._word_at, self.at = found.span() if found else (len(self.text), len(self.text))
        return found.group() if found else ""

    def peek(self) -> str:
        """The next word, without taking it."""
        found = WORD.search(self.text, self.at)
        return found.group() if found else ""

    def keyword(self, *expected: str) -> str:
        """The next word in upper case, which must be the first word of one of these phrases."""
        word = self.take()
        if word.upper() not in [phrase.split()[0].upper() for phrase in expected]:
            self.refuse(word, " or ".join(expected))
        return word.upper()

    def label(self, label: str) -> None:
        """Pass a label such as `Frame Time:`; blanks, line ends and case do not matter."""
        pattern = r"\s*".join(map(re.escape, ["", *label.split(), ":"]))
        found = re.compile(pattern, re.ASCII | re.IGNORECASE).match(self.text, self.at)
        if not found:
            self.refuse(self.take(), f"{label}:")
        self.at = found.end()

    def name(self) -> str:
        """The rest of the line, up to a brace; inner blanks stay."""
        found = next(NAME.finditer(self.text, self.at))  # perhaps empty
        self.at = found.end()
        return found.group().strip(BLANKS)

    def number(self, what: str) -> float:
        """The next word as a number up to `LARGEST`."""
        word = self.take()
        if not is_number(word):
            self.refuse(word, f"{what}, a finite number, at most {LARGEST:g}")
        return float(word)

    def count(self, what: str) -> int:
        """The next word as a whole number, 0 or more."""
        word = self.take()
        if not COUNT.fullmatch(word):
            self.refuse(word, f"{what}, a whole number")
        return int(word)

    def refuse(self, found: str, expected: str) -> NoReturn:
        """Raise the error for a word that is not what was expected."""
        what = f"found {cut(found)!r}" if found else "the file ends"
        raise self.error(f"{what}, expected {expected}")

    def error(self, reason: str, at: int | None = None) -> BvhError:
        """An error at a position in the text, by default at the last word taken."""
        at = self._word_at if at is None else at
        before = self.text[:at] if at < len(self.text) else self.text.rstrip()  # at the end, the last line with words
        return BvhError(self.path, 1 + len(LINE_END.findall(before)), reason)


def is_number(word: str) -> bool:
    """Return whether a word is a number up to `LARGEST` as BVH files write them."""
    return NUMBER.fullmatch(word) is not None and abs(float(word)) <= LARGEST


def is_name(word: str) -> bool:
    """Return whether a name written after JOINT is read back the same."""
    return bool(word) and NAME.fullmatch(word) is not None and word == word.strip(BLANKS)


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
    blank = np.isin(np.frombuffer(b" " + rest, np.uint8), list(b" \t\n\v\f\r"))
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
            return count, begin
        value = whole * powers[power] if power >= 0 else whole / powers[-power]
        numbers[count] = -value if negative else value
        count += 1


@inlined()
def _digits(text: NDArray[np.uint8], at: int, whole: int) -> tuple[int, int]:
    """A whole number with the digits from a place of a text on behind its own, and where these end."""
    digit = _digit(text[at])
    while 0 <= digit <= 9:
        whole, at = 10 * whole + digit, at + 1
        digit = _digit(text[at])
    return whole, at


@inlined()
def _digit(letter: int) -> int:
    """The value of a digit, other letters have none from 0 to 9; in 64 bits, since bytes would overflow."""
    return np.int64(letter) - ZERO  # type: ignore[return-value]


@inlined()
def _is_blank(letter: int) -> bool:
    return letter == SPACE or TAB <= letter <= RETURN
