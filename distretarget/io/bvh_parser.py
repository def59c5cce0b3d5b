"""The words, joints and numbers in the text of a BVH file, each checked; errors name the line."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import BvhError
from distretarget.io.decimals import parse_numbers
from distretarget.motion import LONGEST_FRAME, SHORTEST_FRAME, is_frame_time
from distretarget.skeleton import LARGEST, POSITION_CHANNELS, ROTATION_CHANNELS

MAX_DEPTH = 400  # joints above a joint; bodies have about 40
CHANNELS = {name.upper(): name for name in POSITION_CHANNELS + ROTATION_CHANNELS}
LONGEST_SHOWN = 60  # characters of a word in an error
KEYWORDS = ("HIERARCHY", "ROOT", "JOINT", "END", "OFFSET", "CHANNELS", "MOTION", "{", "}", "")

WORD = re.compile(r"[{}]|[^\s{}]+", re.ASCII)
NAME = re.compile(r"[^{}\r\n\0]*")
LINE_END = re.compile(r"\r\n|\r|\n")
NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
COUNT = re.compile(r"\d{1,18}", re.ASCII)
BLANKS = " \t\v\f"


class Words:
    """The words of a text, taken one after the other; a brace is a word, and at the end of the file words are empty.

    Attributes: `path`, for errors; `text`; `at`, the position up to which it has been read.
    """

    def __init__(self, path: str | Path, text: str) -> None:
        self.path = path
        self.text = text
        self.at = 0
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
        found = NAME.match(self.text, self.at)
        self.at = found.end() if found else self.at
        return found.group().strip(BLANKS) if found else ""

    def number(self, what: str) -> float:
        """The next word as a number up to `LARGEST`."""
        word = self.take()
        if not is_finite(word) or abs(float(word)) > LARGEST:
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
        shown = found if len(found) <= LONGEST_SHOWN else found[:LONGEST_SHOWN] + "..."
        what = f"found {shown!r}" if found else "the file ends"
        raise self.error(f"{what}, expected {expected}")

    def error(self, reason: str, at: int | None = None) -> BvhError:
        """An error at a position in the text, by default at the last word taken."""
        return BvhError(self.path, self.line(self._word_at if at is None else at), reason)

    def line(self, at: int) -> int:
        """The number of the line at a position in the text; at its end, of the last line with words."""
        before = self.text[:at] if at < len(self.text) else self.text.rstrip()
        return 1 + len(LINE_END.findall(before))


def is_finite(word: str) -> bool:
    """Whether a word is a finite number as BVH files write them."""
    return NUMBER.fullmatch(word) is not None and math.isfinite(float(word))


def is_name(word: str) -> bool:
    """Whether a name written after JOINT is read back the same."""
    return bool(word) and NAME.fullmatch(word) is not None and word == word.strip(BLANKS)


class JointText(NamedTuple):
    """A joint or End Site in a HIERARCHY; `parent` counts in the order of the text, and is -1 for the root."""

    name: str
    parent: int
    offset: tuple[float, float, float]  # [file units]
    channels: tuple[str, ...]  # in the usual spelling, `Xposition`
    end_site: bool
    at: int  # its position in the text


def take_hierarchy(words: Words) -> list[JointText]:
    """The joints and End Sites in the order of the text, up to the root's last brace; BvhError if there is no ROOT."""
    words.keyword("HIERARCHY")
    words.keyword("ROOT")
    joints = [_take_joint(words, -1)]
    unclosed = [0]
    while unclosed:
        parent = unclosed[-1]
        expected = ("}",) if joints[parent].end_site else ("JOINT", "End Site", "}")
        keyword = words.keyword(*expected)
        if keyword == "}":
            unclosed.pop()
            continue
        if len(unclosed) > MAX_DEPTH:
            raise words.error(f"found a joint inside {len(unclosed)} others, expected {MAX_DEPTH} at most")
        unclosed.append(len(joints))
        joints.append(_take_joint(words, parent, end_site=keyword == "END"))
    return joints


def _take_joint(words: Words, parent: int, end_site: bool = False) -> JointText:
    """A joint after its keyword, up to its channels."""
    at = words.at
    name = words.name()
    if not name:
        words.refuse(words.take(), "a name")
    words.keyword("{")
    words.keyword("OFFSET")
    offset = (words.number("the x offset"), words.number("the y offset"), words.number("the z offset"))
    return JointText(name, parent, offset, () if end_site else _take_channels(words), end_site, at)


def _take_channels(words: Words) -> tuple[str, ...]:
    if words.peek().upper() != "CHANNELS":
        return ()
    words.take()
    declared = words.count("the number of channels")
    names: list[str] = []
    while words.peek().upper() not in KEYWORDS:
        word = words.take()
        name = CHANNELS.get(word.upper())
        if name is None:
            words.refuse(word, f"a channel, one of {', '.join(CHANNELS.values())}")
        if name in names:
            raise words.error(f"found {word!r} twice, expected each channel once in a joint")
        names.append(name)
    if len(names) != declared:
        raise words.error(f"found {len(names)} channel names, expected {declared} as declared")
    return tuple(names)


def take_motion_keyword(words: Words) -> bool:
    """Pass MOTION; false where the file ends instead, BvhError where something else follows the hierarchy."""
    word = words.take()
    if word.upper() == "ROOT":
        raise words.error("found a second ROOT, expected MOTION: one skeleton in a file")
    if word and word.upper() != "MOTION":
        words.refuse(word, "MOTION")
    return bool(word)


def take_frame_count(words: Words) -> int:
    """The declared number of frames, after MOTION."""
    words.label("Frames")
    return words.count("the number of frames")


def take_frames(words: Words, channels: int) -> tuple[str, NDArray[np.float64]]:
    """The frame time as written [s], and the values (frames, channels), from MOTION to the end of the file.

    Raises:
        BvhError: a word is not a finite number, or there are not as many numbers as declared.
    """
    declared, at = take_frame_count(words), words.at
    words.label("Frame Time")
    time = words.take()
    if not is_frame_time(time):
        bounds = f"from {SHORTEST_FRAME:g} to {LONGEST_FRAME:g}"
        words.refuse(time, f"the time between frames in seconds, a number above 0, {bounds}")
    numbers = parse_numbers(words.text[words.at :].encode("utf-8", "surrogateescape"))
    values = _take_numbers_singly(words) if numbers is None else numbers
    if declared and not channels:
        raise words.error(f"found {declared} frames declared, expected 0 where no joint has channels", at)
    if values.size != declared * channels:
        whole, over = divmod(values.size, channels) if channels else (0, values.size)
        found = f"{whole} whole frames of {channels} numbers" + (f" and {over} numbers over" if over else "")
        raise words.error(f"found {found}, expected {declared} frames as declared", at)
    return time, values.reshape(declared, channels)


def _take_numbers_singly(words: Words) -> NDArray[np.float64]:
    """All numbers to the end of the text, slowly, to name the first word that is not a finite number."""
    numbers: list[float] = []
    while word := words.take():
        if not is_finite(word):
            words.refuse(word, "a finite number or the end of the file")
        numbers.append(float(word))
    return np.array(numbers)
