"""The text of BVH files: its words, names and numbers, each checked."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NoReturn

from distretarget.errors import BvhError, cut
from distretarget.skeleton import LARGEST

WORD = re.compile(r"[{}]|[^\s{}]+", re.ASCII)
NAME = re.compile(r"[^{}\r\n\0]*")
LINE_END = re.compile(r"\r\n|\r|\n")
NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
COUNT = re.compile(r"\d{1,18}", re.ASCII)
BLANKS = " \t\v\f"


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
