"""Read BVH files. Every keyword, name and number is checked; errors name the line."""

from __future__ import annotations

import itertools
import re
import warnings
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import BvhError, SkeletonError, cut
from distretarget.io.files import read_text
from distretarget.io.number_text import parse_numbers
from distretarget.motion import LONGEST_FRAME, SHORTEST_FRAME, Motion, MovingBones, is_frame_time
from distretarget.numerics.euler import write_channel_rotations
from distretarget.numerics.vectors import Array, extent, lengths
from distretarget.skeleton import ALL_CHANNELS, LARGEST, POSITION_CHANNELS, Skeleton

WORD = re.compile(r"[{}]|[^\s{}]+", re.ASCII)
NAME = re.compile(r"[^{}\r\n\0]*")
LINE_END = re.compile(r"\r\n|\r|\n")
NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
COUNT = re.compile(r"\d{1,18}", re.ASCII)
BLANKS = " \t\v\f"
NOISE = 0.01  # position channels that stay this close to zero are noise [length of the OFFSET]
MILLISECONDS = 4.0, 100.0  # a frame time from 10 to 250 frames/s, if it is in milliseconds [s]
MAX_DEPTH = 400  # ancestors of a joint; bodies have about 40
CHANNELS = {name.upper(): name for name in ALL_CHANNELS}
KEYWORDS = ("HIERARCHY", "ROOT", "JOINT", "END", "OFFSET", "CHANNELS", "MOTION", "{", "}", "")


class Words:
    """A text, read word by word. A brace is a word; at the end of the text, words are empty."""

    def __init__(self, path: str | Path, text: str) -> None:
        self.path, self.text = path, text
        self.at = 0  # the position up to which the text has been read
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
        """The rest of the line, up to a brace, with inner blanks; may be empty."""
        found = next(NAME.finditer(self.text, self.at))
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
        """Raise the error for the last word taken, `found` where `expected` had to be."""
        what = f"found {cut(found)!r}" if found else "the file ends"
        raise self.error(f"{what}, expected {expected}")

    def error(self, reason: str, at: int | None = None) -> BvhError:
        """An error at a position in the text, by default at the last word taken."""
        at = self._word_at if at is None else at
        before = self.text[:at] if at < len(self.text) else self.text.rstrip()  # at the end: the last line with words
        return BvhError(self.path, 1 + len(LINE_END.findall(before)), reason)


def is_number(word: str) -> bool:
    """Return whether a word is a number up to `LARGEST` as BVH files write them."""
    return NUMBER.fullmatch(word) is not None and abs(float(word)) <= LARGEST


def is_name(word: str) -> bool:
    """Return whether a name written after JOINT is read back the same."""
    return bool(word) and NAME.fullmatch(word) is not None and word == word.strip(BLANKS)


def read_bvh(path: str | Path) -> Motion:
    """Return the motion of a BVH file. A position channel replaces its component of the OFFSET, or is added to it
    (`add_offsets`); End Sites become joints called `<parent>_End`, `<parent>_End2`, ...

    Raises:
        FileError, BvhError: the file cannot be read as text, or is not a complete BVH file.

    Warns:
        UserWarning: it has one frame more or fewer than declared, or a frame time that seems to be in milliseconds.
    """
    text = read_text(path)
    motion = parse_bvh(text, path)
    for note in bvh_warnings(text, motion):
        warnings.warn(note, stacklevel=2)
    return motion


def parse_bvh(text: str, path: str | Path) -> Motion:
    """Return the motion in the text of a BVH file as `read_bvh` does; `path` is for errors."""
    words = Words(path, text)
    skeleton = _take_skeleton(words)
    if not _take_motion_keyword(words):
        words.refuse("", "MOTION")
    return _take_motion(words, skeleton)


def bvh_warnings(text: str, motion: Motion) -> Iterator[str]:
    """Yield the warnings of `read_bvh`, a line each, for a BVH text and the motion in it."""
    declared = declared_frames(text)
    if declared != len(motion):
        yield f"the file declares {declared} frames and has {len(motion)}; these are read"
    if MILLISECONDS[0] <= motion.frame_time <= MILLISECONDS[1]:
        rate = f"{1000.0 / motion.frame_time:.4g} frames/s"
        yield f"the frame time is {motion.frame_time_text} s; in milliseconds it would be {rate}: write it in seconds"


def parse_bvh_skeleton(text: str, path: str | Path) -> Skeleton:
    """Return the skeleton in the HIERARCHY of a BVH file, or raise a BvhError. The MOTION may be missing or damaged,
    unless joints below the root have position channels: then bone lengths come from it (`Motion.rigid_skeleton`).
    """
    words = Words(path, text)
    skeleton = _take_skeleton(words)
    has_motion = _take_motion_keyword(words)
    return _take_motion(words, skeleton).rigid_skeleton if has_motion and _positioned(skeleton).size else skeleton


def declared_frames(text: str) -> int | None:
    """Return how many frames a BVH text declares, 0 if it ends after its HIERARCHY; None if it is not BVH."""
    words = Words("", text)
    with suppress(BvhError):
        _take_skeleton(words)
        return _take_frame_count(words) if _take_motion_keyword(words) else 0
    return None


def _take_skeleton(words: Words) -> Skeleton:
    """The skeleton in a HIERARCHY; clips of one rig share the object, and so what is cached on it."""
    with suppress(BvhError):
        skeleton, words.at = _skeleton_in(words.text[: words.text.find("\nMOTION") + 1])
        return skeleton
    return _new_skeleton(words)


@lru_cache(maxsize=4)
def _skeleton_in(hierarchy: str) -> tuple[Skeleton, int]:
    words = Words("", hierarchy)
    return _new_skeleton(words), words.at


def _new_skeleton(words: Words) -> Skeleton:
    """The skeleton in a HIERARCHY, up to the root's last brace."""
    words.keyword("HIERARCHY")
    names, parents, offsets, places = list[str](), list[int](), list[list[float]](), list[int]()
    channels, end_sites = list[tuple[str, ...]](), list[bool]()
    unclosed, keyword = list[int](), words.keyword("ROOT")
    while True:
        if keyword == "}":
            unclosed.pop()
        else:
            if len(unclosed) > MAX_DEPTH:
                raise words.error(f"found a joint inside {len(unclosed)} others, expected {MAX_DEPTH} at most")
            places.append(words.at)
            names.append(words.name())
            if not names[-1]:
                words.refuse(words.take(), "a name")
            words.keyword("{")
            words.keyword("OFFSET")
            offsets.append([words.number(f"the {axis} offset") for axis in "xyz"])
            end_sites.append(keyword == "END")
            channels.append(() if end_sites[-1] else _take_channels(words))
            parents.append(unclosed[-1] if unclosed else -1)
            unclosed.append(len(names) - 1)
        if not unclosed:
            break
        keyword = words.keyword(*(("}",) if end_sites[unclosed[-1]] else ("JOINT", "End Site", "}")))
    names = [*joint_names(names, parents, end_sites)]
    try:
        return Skeleton(
            names=tuple(names),
            parents=np.array(parents),
            offsets=np.array(offsets),
            channels=tuple(channels),
            end_sites=np.array(end_sites),
        )
    except SkeletonError as error:
        raise words.error(str(error), places[_first_duplicate(names, parents)]) from error


def joint_names(names: Sequence[str], parents: Sequence[int], end_sites: Sequence[bool]) -> tuple[str, ...]:
    """Return the names of joints, parents first, with End Sites named `<parent>_End`, `<parent>_End2`, ..."""
    taken = {name for name, end_site in zip(names, end_sites, strict=True) if not end_site}
    unused: defaultdict[str, Iterator[str]] = defaultdict(lambda: itertools.chain([""], map(str, itertools.count(2))))
    complete: list[str] = []
    for name, parent, end_site in zip(names, parents, end_sites, strict=True):
        above = complete[parent] if end_site else ""
        numbered = (f"{above}_End{number}" for number in unused[above])
        complete.append(next(end for end in numbered if end not in taken) if end_site else name)
    return tuple(complete)


def _first_duplicate(names: Sequence[str], parents: Sequence[int]) -> int:
    """The first joint with the same names from the root down as an earlier joint, else the root."""
    paths: list[tuple[str, ...]] = []
    for name, parent in zip(names, parents, strict=True):
        paths.append((*(paths[parent] if parent >= 0 else ()), name))
        if paths[-1] in paths[:-1]:
            return len(paths) - 1
    return 0


def _take_motion(words: Words, skeleton: Skeleton) -> Motion:
    frame_time_text, values = _take_frames(words, sum(map(len, skeleton.channels)))
    column = itertools.count()
    columns = [{channel: next(column) for channel in channels} for channels in skeleton.channels]
    joints = np.append(0, _positioned(skeleton))
    translations = np.tile(skeleton.offsets[joints], (len(values), 1, 1))
    for row, joint in enumerate(joints):
        for component, channel in enumerate(POSITION_CHANNELS):
            if channel in columns[joint]:
                translations[:, row, component] = values[:, columns[joint][channel]]
    add_offsets(skeleton, joints, translations)
    if extent(translations) > LARGEST:
        raise words.error(f"positions with their OFFSETs added go beyond {LARGEST:g}; use other units")
    moving = MovingBones.among(skeleton, joints, translations)
    rotations = _rotations(skeleton, columns, values)
    return Motion(skeleton, np.ascontiguousarray(translations[:, 0]), rotations, frame_time_text, moving)


def _positioned(skeleton: Skeleton) -> NDArray[np.intp]:
    """The joints below the root that have position channels."""
    positioned = [not set(POSITION_CHANNELS).isdisjoint(channels) for channels in skeleton.channels[1:]]
    return np.flatnonzero(positioned) + 1


def add_offsets(skeleton: Skeleton, joints: NDArray[np.intp], translations: Array) -> None:
    """Add OFFSETs to `translations`, (frames, joints, 3), if position channels hold only noise, as in MakeHuman's."""
    sizes = skeleton.lengths[joints]
    positioned = [joint > 0 and set(POSITION_CHANNELS) <= set(skeleton.channels[joint]) for joint in joints]
    rows = np.flatnonzero(positioned & (sizes > 0))
    if len(rows) < 2 or not len(translations):
        return
    largest = lengths(translations[:, rows]).max(axis=0)
    if np.median(largest / sizes[rows]) < NOISE:
        translations[:, rows] += skeleton.offsets[joints[rows]]


def _rotations(skeleton: Skeleton, columns: Sequence[Mapping[str, int]], values: Array) -> Array:
    """Local rotations, (frames, joints, 4), from channel `values`, (frames, channels); `columns` are per joint."""
    rotations = np.tile(skeleton.rest_rotations, (len(values), 1, 1))
    orders: defaultdict[str, list[int]] = defaultdict(list)
    for joint in range(len(skeleton)):
        orders[skeleton.rotation_axes(joint)].append(joint)
    for axes in filter(None, orders):
        chosen = np.array([[columns[joint][f"{axis}rotation"] for axis in axes] for joint in orders[axes]], np.intp)
        write_channel_rotations(values, chosen, axes, np.array(orders[axes], np.intp), rotations)
    return rotations


def _take_channels(words: Words) -> tuple[str, ...]:
    if words.peek().upper() != "CHANNELS":
        return ()
    words.take()
    declared, names = words.count("the number of channels"), []
    while words.peek().upper() not in KEYWORDS:
        word = words.take()
        if not (name := CHANNELS.get(word.upper())):
            words.refuse(word, f"a channel, one of {', '.join(CHANNELS.values())}")
        if name in names:
            raise words.error(f"found {word!r} twice, expected each channel once in a joint")
        names.append(name)
    if len(names) != declared:
        raise words.error(f"found {len(names)} channel names, expected {declared} as declared")
    return tuple(names)


def _take_motion_keyword(words: Words) -> bool:
    """Pass MOTION; return False if the file ends instead. A BvhError if anything else follows the hierarchy."""
    word = words.take()
    if word.upper() == "ROOT":
        raise words.error("found a second ROOT, expected MOTION: one skeleton in a file")
    if word and word.upper() != "MOTION":
        words.refuse(word, "MOTION")
    return bool(word)


def _take_frame_count(words: Words) -> int:
    words.label("Frames")
    return words.count("the number of frames")


def _take_frames(words: Words, channels: int) -> tuple[str, NDArray[np.float64]]:
    """The frame time as written [s], and the values, (frames, channels): as declared, or one frame more or fewer."""
    declared, at = _take_frame_count(words), words.at
    words.label("Frame Time")
    time = words.take()
    if not is_frame_time(time):
        bounds = f"from {SHORTEST_FRAME:g} to {LONGEST_FRAME:g}"
        words.refuse(time, f"the time between frames in seconds, a number above 0, {bounds}")
    numbers = parse_numbers(words.text[words.at :].encode("utf-8", "surrogateescape"))
    values = _take_numbers_singly(words) if numbers is None or extent(numbers) > LARGEST else numbers
    if declared and not channels:
        raise words.error(f"found {declared} frames declared, expected 0 where no joint has channels", at)
    whole, over = divmod(values.size, channels) if channels else (0, values.size)
    off_by_one = not over and whole > 0 and declared > 0 and abs(whole - declared) == 1
    if values.size != declared * channels and not off_by_one:
        found = f"{whole} whole frames of {channels} numbers" + (f" and {over} numbers over" if over else "")
        raise words.error(f"found {found}, expected {declared} frames as declared", at)
    return time, values.reshape(whole if off_by_one else declared, channels)


def _take_numbers_singly(words: Words) -> NDArray[np.float64]:
    """All numbers to the end of the text; slow, but the error names the first word that is not a valid number."""
    numbers: list[float] = []
    while word := words.take():
        if not is_number(word):
            words.refuse(word, f"a finite number, at most {LARGEST:g}, or the end of the file")
        numbers.append(float(word))
    return np.array(numbers)
