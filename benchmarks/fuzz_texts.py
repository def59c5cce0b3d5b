"""Generated clips, skeleton files, maps and records, read and retargeted, written and read again."""

from __future__ import annotations

import contextlib
import json
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pybvh
from fuzz_outcomes import NotReadBackError, check_close, read_back
from hypothesis import strategies as st

from distretarget import Motion, Options, Skeleton, Tally, Target
from distretarget.batch.results import packed_part, unpacked
from distretarget.io.bvh import parse_bvh
from distretarget.io.bvh_writer import bvh_parts, python_refusals
from distretarget.io.input_file import InputFile
from distretarget.io.map_json import parse_map
from distretarget.io.reading import TargetFile, parse_target
from distretarget.io.skeleton_json import skeleton_to_json
from distretarget.pipeline.retargeting import Conversion, Recipe

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))
import strategies as made

SAME = 1e-6  # tolerance of positions that are read back [of the largest coordinate]

texts = st.one_of(
    st.tuples(st.just("clip"), st.one_of(made.clips, made.broken(made.clips))),
    st.tuples(st.just("target"), st.one_of(made.targets, made.broken_json(made.skeleton_files()))),
    st.tuples(st.just("map"), st.one_of(made.map_files, made.broken_json(made.map_files))),
    st.tuples(st.just("record"), st.one_of(made.records(), made.broken_json(made.records()))),
)
jobs = made.often(
    st.tuples(made.pairs, st.just("{}"), made.options),
    st.tuples(made.pairs, made.map_files, made.strange_options),
    st.tuples(st.tuples(made.broken(made.clips), made.targets), st.just("{}"), made.options),
)


def _file(text: str, path: str) -> InputFile:
    """A file with a text."""
    return InputFile(text.encode("utf-8", "surrogateescape"), path)


def read(case: tuple[str, str]) -> None:
    """Parse a text, write the result, parse that, and compare."""
    kind, text = case
    if kind == "clip":
        motion = parse_bvh(text, "clip.bvh")
        _same_motion(motion, read_back(lambda: parse_bvh("".join(bvh_parts(motion)), "again.bvh")))
    elif kind == "target":
        target = parse_target(_file(text, "target.json"))
        if isinstance(target, Target):
            written, body = skeleton_to_json(target.skeleton, target.name, target.map), target.skeleton
            again = read_back(lambda: parse_target(_file(written, "again.json"))).skeleton
            if body.keys != again.keys or body.channels != again.channels:
                raise NotReadBackError("joints or channels")
            _check_same(body.offsets, again.offsets, "offsets")
    elif kind == "map":
        pairs = dict(parse_map(text, "map.json").pairs)
        if dict(parse_map(json.dumps(pairs), "again.json").pairs) != pairs:
            raise NotReadBackError("the map")
    else:
        with contextlib.suppress(ValueError):  # the database says that it is damaged
            tally = Tally(clips=3, seconds=1.0)
            tally.add(unpacked("{}", "{}", packed_part(text.encode("utf-8", "surrogatepass")), packed_part(b"")))
            assert tally.lines


def convert(case: tuple[tuple[str, str], str, dict[str, Any]]) -> None:
    """Retarget a clip, write the result, parse it, and compare."""
    (source, target), joint_map, options = case
    chosen = Options(**{key: value for key, value in options.items() if key not in ("jobs", "q")})
    clip, recipe = _file(source, "clip.bvh"), Recipe(chosen, parse_map(joint_map, "map.json"))
    body = TargetFile.of(_file(target, "target"))
    result = Conversion.of(recipe.read(clip)[0], clip, body, recipe).converted("clip", ("BVH",)).result
    text = "".join(bvh_parts(result.motion))
    again = read_back(lambda: parse_bvh(text, "again.bvh"))
    _same_motion(result.motion, again)
    _check_other_reader(text, result.motion.skeleton)
    if len(again) != len(result.source):
        raise NotReadBackError(f"{len(again)} frames of {len(result.source)}")
    json.dumps(result.metrics, allow_nan=False)
    list(result.warnings)


def _check_other_reader(text: str, skeleton: Skeleton) -> None:
    """Check that pybvh reads a result, or that the program warns that it cannot."""
    with tempfile.NamedTemporaryFile(suffix=".bvh") as file:
        file.write(text.encode("utf-8", "surrogateescape"))
        file.flush()
        try:
            with warnings.catch_warnings(action="ignore"):
                pybvh.read_bvh_file(file.name)
        except Exception as error:
            if not any("pybvh" in line for line in python_refusals(skeleton)):
                raise NotReadBackError(f"pybvh cannot read it, and no line says so: {error!r}") from error


def _same_motion(motion: Motion, again: Motion) -> None:
    order = list(motion.skeleton.depth_first)  # in which BVH files list joints; their End Sites have no names
    if _named(motion.skeleton) != _named(again.skeleton):
        raise NotReadBackError("joints or channels")
    _check_same(motion.skeleton.offsets[order[1:]], again.skeleton.offsets[1:], "offsets")
    if motion.positions.shape != again.positions.shape or motion.frame_time_text != again.frame_time_text:
        raise NotReadBackError("frames or frame time")
    if sum(channel.endswith("position") for channel in motion.skeleton.channels[0]) == 3:
        _check_same(motion.positions[:, order], again.positions, "positions")


def _named(skeleton: Skeleton) -> list[tuple[str, tuple[str, ...]]]:
    """Names and channels of all joints, depth first; End Sites without their names."""
    ends = skeleton.end_sites
    return [("" if ends[j] else skeleton.names[j], skeleton.channels[j]) for j in skeleton.depth_first]


def _check_same(values: np.ndarray, others: np.ndarray, what: str) -> None:
    check_close(values, others, SAME * max(1.0, np.abs(values).max(initial=0.0)), what)
