"""Clips of which joints have other names than expected: a result, or an error of one line."""

import re
from itertools import combinations

import numpy as np
import pytest
from bodies import SAMPLES, sample, sample_target

from distretarget import DistretargetError, retarget
from distretarget.io.bvh import parse_bvh
from distretarget.io.input_file import InputFile
from distretarget.io.target_file import parse_target

SHORT = 3  # frames
TEXT = (SAMPLES / "walk.bvh").read_text()
NAMES = re.findall(r"(?:ROOT|JOINT) (\w+)", TEXT)
HIERARCHY, FRAMES = TEXT.split("Frames: ")
HEAD, *ROWS = FRAMES.splitlines()[1:]
LEGS = [name for name in NAMES if re.search("Hip|Knee|Ankle|Toe", name)]
TARGET = sample_target("child")


def renamed(names):
    """The first frames of a walk with other names of joints, by their own."""
    hierarchy = re.sub(r"(ROOT|JOINT) (\w+)", lambda found: f"{found[1]} {names.get(found[2], found[2])}", HIERARCHY)
    return parse_bvh("\n".join([f"{hierarchy}Frames: {SHORT}", HEAD, *ROWS[:SHORT]]), "walk.bvh")


def is_faulty(clip):
    """Whether a clip becomes neither a finite result with metrics nor an error of one line."""
    try:
        result = retarget(clip, TARGET)
        metrics, warnings = result.metrics, [*result.warnings]
    except DistretargetError as refused:
        return "\n" in str(refused)  # an error of several lines is a fault
    return not (np.isfinite(result.motion.positions).all() and metrics) or "nan" in " ".join(warnings)


@pytest.mark.parametrize("count", [1, 2])
def test_joints_with_unknown_names_do_no_harm(count):
    chosen = [*combinations(NAMES, count)][::count]
    assert not [names for names in chosen if is_faulty(renamed({name: f"Foo{k}" for k, name in enumerate(names)}))]


def test_two_joints_of_the_legs_may_have_each_others_names():
    assert not [pair for pair in combinations(LEGS, 2) if is_faulty(renamed(dict(zip(pair, pair[::-1], strict=True))))]


def test_a_whole_walk_with_an_unknown_knee():
    walk = sample("walk")
    unknown = parse_bvh(TEXT.replace("JOINT LeftKnee", "JOINT Foo"), "walk.bvh")
    result, expected = (retarget(clip, TARGET).motion for clip in (unknown, walk))
    np.testing.assert_allclose(result.positions, expected.positions, atol=1e-9)


def test_hips_below_each_other_and_targets_at_no_place_do_no_harm():
    """The hips give no axis across the body; the frames of a target with an impossible one are not used."""
    below = re.sub(r"(JOINT (?:Left|Right)Hip\s*\{\s*OFFSET).*", r"\1 0 -5 0", HIERARCHY)
    head, rows = f"{below}Frames: 2\n{HEAD}\n", ROWS[:2]
    assert not is_faulty(parse_bvh(head + "\n".join(rows), "below.bvh"))
    far = parse_target(InputFile("\n".join([head + f"1e308 {rows[0].partition(' ')[2]}", rows[1]]).encode(), "far.bvh"))
    assert far.motion is None
