"""The text of BVH files: its words, joints and numbers, each checked, and refused with the line."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import BvhError
from distretarget.io.decimals import parse_numbers
from distretarget.motion import LONGEST_FRAME, SHORTEST_FRAME, is_frame_time
from distretarget.skeleton import LARGEST, POSITION_CHANNELS, ROTATION_CHANNELS

MAX_DEPTH = 400
"""The most joints that a joint may be inside of; bodies have a tenth of them."""

CHANNELS = {name.upper(): name for name in POSITION_CHANNELS + ROTATION_CHANNELS}
LONGEST_SHOWN = 60
KEYWORDS = ("HIERARCHY", "ROOT", "JOINT", "END", "OFFSET", "CHANNELS", "MOTION", "{", "}", "")

WORD = re.compile(r"[{}]|[^\s{}]+", re.ASCII)
NAME = re.compile(r"[^{}\r\n\0]*")
LINE_END = re.compile(r"\r\n|\r|\n")
NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
COUNT = re.compile(r"\d{1,18}", re.ASCII)
BLANKS = " \t\v\f"


class Words:
    """The words of a text one after the other; a brace is a word of its own. Empty at the end of the file.

    Attributes: `path`, for the errors, `text`, and `at`, how far it has been read.
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
        """The next word, which stays the next."""
        found = WORD.search(self.text, self.at)
        return found.group() if found else ""

    def keyword(self, *expected: str) -> str:
        """The next word in upper case, which must be the first of one of these."""
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
        """What is left of the line, or up to a brace; inner blanks stay as they are."""
        found = NAME.match(self.text, self.at)
        self.at += len(found.group()) if found else 0
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
        """An error at a place in the text, without one at the word last taken."""
        return BvhError(self.path, self.line(self._word_at if at is None else at), reason)

    def line(self, at: int) -> int:
        """The number of the line at a place in the text; where the text ends, of its last line with words."""
        before = self.text[:at]
        return 1 + sum(1 for _ in LINE_END.finditer(before if at < len(self.text) else before.rstrip()))


def is_finite(word: str) -> bool:
    """Whether a word is a finite number as BVH files write them."""
    return NUMBER.fullmatch(word) is not None and math.isfinite(float(word))


def is_name(word: str) -> bool:
    """Whether a name can be written after JOINT and is read back the same."""
    return bool(word) and NAME.fullmatch(word) is not None and word == word.strip(BLANKS)


@dataclass(frozen=True, kw_only=True)
class JointText:
    """A joint as its text has it.

    Attributes:
        name: as written; of End Sites what stands after `End`.
        parent: the number of the joint it is inside of, in the order of the text; -1 for the root.
        offset: to the parent [file units].
        channels: in the usual spelling, `Xposition`.
        end_site: whether it is one.
        at: where it stands in the text.
    """

    name: str
    parent: int
    offset: tuple[float, float, float]
    channels: tuple[str, ...]
    end_site: bool
    at: int


def take_hierarchy(words: Words) -> list[JointText]:
    """The joints and End Sites in the order of the text, up to the root's last brace.

    Raises:
        BvhError: the text is not a HIERARCHY with one ROOT.
    """
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
    return JointText(
        name=name,
        parent=parent,
        offset=offset,
        channels=() if end_site else _take_channels(words),
        end_site=end_site,
        at=at,
    )


def _take_channels(words: Words) -> tuple[str, ...]:
    if words.peek().upper() != "CHANNELS":
        return ()
    words.take()
    declared = words.count("the number of channels")
    names: list[str] = []
    while words.peek().upper() not in KEYWORDS:
        names.append(_take_channel(words, names))
    if len(names) != declared:
        raise words.error(f"found {len(names)} channel names, expected {declared} as declared")
    return tuple(names)


def _take_channel(words: Words, before: list[str]) -> str:
    word = words.take()
    name = CHANNELS.get(word.upper())
    if name is None:
        words.refuse(word, f"a channel, one of {', '.join(CHANNELS.values())}")
    if name in before:
        raise words.error(f"found {word!r} twice, expected each channel once in a joint")
    return name


def take_motion_keyword(words: Words) -> bool:
    """Pass MOTION; false where the file ends instead.

    Raises:
        BvhError: something else follows the hierarchy.
    """
    word = words.take()
    if word.upper() == "ROOT":
        raise words.error("found a second ROOT, expected MOTION: one skeleton in a file")
    if word and word.upper() != "MOTION":
        words.refuse(word, "MOTION")
    return bool(word)


@dataclass(frozen=True, eq=False)
class FramesText:
    """The frames as their text has them.

    Attributes:
        frame_time_text: the time between frames [s], as written.
        values: (frames, channels).
    """

    frame_time_text: str
    values: NDArray[np.float64]


def take_frame_count(words: Words) -> int:
    """The number of frames that stands after MOTION."""
    words.label("Frames")
    return words.count("the number of frames")


def take_frames(words: Words, channels: int) -> FramesText:
    """The frames of so many channels each, after MOTION up to the end of the file.

    Raises:
        BvhError: a word that is not a finite number, or not as many numbers as declared.
    """
    declared, at = take_frame_count(words), words.at
    words.label("Frame Time")
    time = words.take()
    if not is_frame_time(time):
        bounds = f"from {SHORTEST_FRAME:g} to {LONGEST_FRAME:g}"
        words.refuse(time, f"the time between frames in seconds, a number above 0, {bounds}")
    values = _take_numbers(words)
    if declared and not channels:
        raise words.error(f"found {declared} frames declared, expected 0 where no joint has channels", at)
    if values.size != declared * channels:
        whole, over = divmod(values.size, channels) if channels else (0, values.size)
        found = f"{whole} whole frames of {channels} numbers" + (f" and {over} numbers over" if over else "")
        raise words.error(f"found {found}, expected {declared} frames as declared", at)
    return FramesText(time, values.reshape(declared, channels))


def _take_numbers(words: Words) -> NDArray[np.float64]:
    """All numbers up to the end of the text, (numbers,)."""
    numbers = parse_numbers(words.text[words.at :].encode("utf-8", "surrogateescape"))
    return _take_numbers_singly(words) if numbers is None else numbers


def _take_numbers_singly(words: Words) -> NDArray[np.float64]:
    """The same, slowly, to name the first word that is not a finite number."""
    numbers: list[float] = []
    while word := words.take():
        if not is_finite(word):
            words.refuse(word, "a finite number or the end of the file")
        numbers.append(float(word))
    return np.array(numbers)
