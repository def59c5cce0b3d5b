"""BVH files as they are written: their text, its numbers, and that it reads back the same."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from bodies import tree_of
from bvh_texts import HIERARCHY, TEXT, assert_same, edit, format_bvh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from distretarget.errors import MotionError, SkeletonError
from distretarget.io.bvh import parse_bvh, read_bvh
from distretarget.io.bvh_writer import write_bvh
from distretarget.io.number_text import parse_numbers, rows_text
from distretarget.motion import Motion
from distretarget.skeleton import Skeleton


def read(text):
    return parse_bvh(text, "a.bvh")


def test_names_in_an_unknown_encoding_are_kept_byte_for_byte(tmp_path):
    (tmp_path / "a.bvh").write_bytes(TEXT.encode().replace(b"Hips", b"H\xfcfte"))
    write_bvh(tmp_path / "b.bvh", read_bvh(tmp_path / "a.bvh"))
    assert b"ROOT H\xfcfte\n" in (tmp_path / "b.bvh").read_bytes()


def test_writing():
    motion = read(edit(("0 10 0 0", "-0 10 -1e-9 -4e-7")))
    lines = format_bvh(motion).splitlines()
    assert lines[:9] == [
        "HIERARCHY",
        "ROOT Hips",
        "{",
        "  OFFSET 0.000000 0.000000 0.000000",
        "  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation",
        "  JOINT Chest",
        "  {",
        "    OFFSET 0.000000 5.250000 0.100000",
        "    CHANNELS 3 Yrotation Xrotation Zrotation",
    ]
    assert lines[13:17] == ["      End Site", "      {", "        OFFSET 0.000000 1.000000 0.500000", "      }"]
    assert lines[-6:-3] == ["MOTION", "Frames: 3", "Frame Time: 0.0333333"]
    assert lines[-3] == "0.0000000 10.0000000 0.0000000" + 9 * " 0.000000"
    assert format_bvh(motion).endswith("\n")
    assert "\r" not in format_bvh(motion)
    zero = HIERARCHY.replace("OFFSET 1.0 2.0 3.0", "OFFSET 0.0 0.0 0.0")
    written = format_bvh(read(TEXT)).split("MOTION")[0]
    assert re.sub(r"(\.\d+?)0+\b", r"\1", written) == zero
    motion = read(edit(("5.25", "5.0123456789012345"), (" 0.1\n", " 1e-12\n")))
    again = read(format_bvh(motion))
    np.testing.assert_array_equal(again.skeleton.offsets[1:], motion.skeleton.offsets[1:])


def test_a_root_offset_stays_where_no_channel_replaces_it():
    text = edit(
        ("6 Xposition Yposition Zposition", "4 Yposition"),
        ("0 10 0", "10"),
        ("0.5 10.25 1", "10.25"),
        ("1 10.5 2", "10.5"),
    )
    motion = read(text)
    assert motion.root_positions[0].tolist() == [1.0, 10.0, 3.0]
    assert "  OFFSET 1.000000 0.000000 3.000000\n" in format_bvh(motion)
    assert_same(read(format_bvh(motion)), motion, 1e-6)


@pytest.mark.parametrize("scale", [1e-4, 1e-2, 1.0, 100.0])
def test_positions_are_written_to_1e_8_of_the_body_in_any_unit(scale):
    motion = read(TEXT)
    small = Motion.of_translations(motion.skeleton.with_offsets(scale * motion.skeleton.offsets),
                   scale * motion.translations, motion.rotations, "1")  # fmt: skip
    size = small.skeleton.longest_path
    again = read(format_bvh(small))
    np.testing.assert_allclose(again.root_positions, small.root_positions, rtol=0, atol=max(0.5e-8 * size, 1e-15))


CHANNELS = ("Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation")


@st.composite
def skeletons(draw):
    """Random bodies of 2 to 7 joints, depth first, in any unit and with any channels."""
    count = draw(st.integers(2, 7))
    chance = np.random.default_rng(draw(st.integers(0, 2**32)))
    depths = [0]
    while len(depths) < count:
        depths.append(draw(st.integers(1, depths[-1] + 1)))
    parents = [-1 if not depth else depths[:joint][::-1].index(depth - 1) for joint, depth in enumerate(depths)]
    parents = [joint - 1 - back if joint else -1 for joint, back in enumerate(parents)]
    end_sites = [joint > 0 and joint not in parents and chance.random() < 0.7 for joint in range(count)]
    names: list[str] = []
    for joint, parent in enumerate(parents):
        twins = [j for j in range(joint) if end_sites[j] and parents[j] == parent]
        number = len(twins) + 1 if twins else ""
        names.append(f"{names[parent]}_End{number}" if end_sites[joint] else f"joint {joint}")
    channels = [() if end else tuple(draw(st.permutations(CHANNELS))[: draw(st.integers(1, 6))]) for end in end_sites]
    offsets = 10.0 ** draw(st.integers(-2, 3)) * chance.normal(size=(count, 3))
    return Skeleton(
        names=tuple(names),
        parents=np.array(parents),
        offsets=offsets,
        channels=tuple(channels),
        end_sites=np.array(end_sites),
    )


@st.composite
def motions(draw):
    """Random bodies with random frames, as the channels of each joint allow them, many at gimbal lock."""
    skeleton = draw(skeletons())
    chance = np.random.default_rng(draw(st.integers(0, 2**32)))
    frames = draw(st.integers(0, 4))
    translations = np.tile(skeleton.offsets, (frames, 1, 1))
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (frames, len(skeleton), 1))
    for joint, channels in enumerate(skeleton.channels):
        for channel in channels:
            if channel.endswith("position"):
                translations[:, joint, "XYZ".index(channel[0])] *= chance.normal(0, 5, frames)
            else:
                angles = chance.choice([0, 90, -90, 180, 33.3], (frames, 1))
                turn = Rotation.from_euler(channel[0], angles, degrees=True)
                rotations[:, joint] = (Rotation.from_quat(rotations[:, joint]) * turn).as_quat()
    return Motion.of_translations(
        skeleton, translations, rotations, draw(st.sampled_from([".04", "8.3333E-3", "0.008333330000000001", "1"]))
    )


@settings(max_examples=80)
@given(motions())
def test_what_is_written_reads_back_the_same(motion):
    again = read(format_bvh(motion))
    size = np.max(np.abs(motion.positions), initial=np.max(motion.skeleton.lengths))
    assert_same(again, motion, 1e-6 * size)
    replaced = [name in motion.skeleton.channels[0] for name in ("Xposition", "Yposition", "Zposition")]
    np.testing.assert_array_equal(again.skeleton.offsets[0], np.where(replaced, 0, motion.skeleton.offsets[0]))
    np.testing.assert_array_equal(again.skeleton.offsets[1:], motion.skeleton.offsets[1:])


def test_joints_are_written_depth_first_whatever_their_numbers():
    offsets = np.arange(12.0).reshape(4, 3)
    channels = tuple((f"{axis}rotation",) for axis in "XYZX")
    skeleton = replace(tree_of(offsets, "abcd", [-1, 0, 0, 1]), channels=channels)
    rotations = np.array([Rotation.from_euler(axis, 0.1).as_quat() for axis in "XYZX"])
    motion = Motion.of_translations(skeleton, offsets[None], rotations[None], "1")
    again = read(format_bvh(motion))
    assert again.skeleton.names == ("a", "b", "d", "c")
    np.testing.assert_allclose(again.positions, motion.positions[:, [0, 1, 3, 2]], atol=1e-6)


@pytest.mark.parametrize("name", ["", " a", "a\t", "a\nb", "a{b", "a\0"])
def test_names_that_bvh_cannot_hold_are_refused(name):
    skeleton = tree_of(np.zeros((1, 3)), [name])
    with pytest.raises(SkeletonError, match=re.escape(repr(name))):
        format_bvh(Motion(skeleton, np.zeros((0, 3)), np.zeros((0, 1, 4)), "1"))


def test_values_that_are_not_finite_are_not_written(tmp_path):
    motion = read(TEXT)
    path = np.array(motion.root_positions)
    path[1, 1] = np.inf
    with pytest.raises(MotionError, match="finite"):
        write_bvh(tmp_path / "b.bvh", replace(motion, root_positions=path))
    assert not (tmp_path / "b.bvh").exists()


WORDS = st.one_of(
    st.from_regex(r"[+-]?([0-9]{1,20}\.?[0-9]{0,20}|\.[0-9]{1,9})([eE][+-]?[0-9]{1,2})?", fullmatch=True),
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.integers(-(2**60), 2**60).map(str),
)
BLANKS = st.text(" \t\n\v\f\r", min_size=1, max_size=3)


@settings(max_examples=60)
@given(st.lists(st.tuples(WORDS, BLANKS)), BLANKS)
def test_numbers_are_those_that_python_reads(words, first):
    text = first + "".join(word + blank for word, blank in words)
    numbers = parse_numbers(text.encode())
    assert numbers is not None
    expected = np.array([float(word) for word, _ in words])
    np.testing.assert_array_equal(numbers, expected)
    np.testing.assert_array_equal(np.signbit(numbers), np.signbit(expected))


UNFINISHED = ["-", "+", ".", "1e", "1e+", "e5", "--1", "1-2", "1.2.3"]
STRANGE = ["x", "1_0", "0x10", "nan", "-inf", "1e400", "1}", "1\x00", "é"]


@pytest.mark.parametrize("before", ["", "1 2.5 ", "1 0.12345678901234567890 "])
@pytest.mark.parametrize("word", [*UNFINISHED, *STRANGE])
def test_a_word_that_is_no_finite_number_is_refused(before, word):
    for after in ("", " 3"):
        assert parse_numbers((before + word + after).encode()) is None


def test_the_end_of_the_text_ends_a_number():
    for text, expected in (("", []), (" \n", []), ("1", [1.0]), ("1 -2.", [1.0, -2.0])):
        assert parse_numbers(text.encode()).tolist() == expected


def by_operator(values, decimals):
    line = " ".join(f"%.{places}f" for places in decimals)
    return "".join(f"{line % tuple(row)}\n" for row in values.tolist())


numbers = st.one_of(
    st.floats(-1e4, 1e4),
    st.floats(allow_nan=False, allow_infinity=False),
    st.integers(-(10**12), 10**12).map(lambda number: number / 2e6),  # half of the last digit, if 6 are written
    st.integers(-(10**9), 10**9).map(float),
)


@given(st.data())
def test_the_text_is_that_of_the_operator(data):
    decimals = data.draw(st.lists(st.integers(1, 20), min_size=1, max_size=4))
    values = data.draw(arrays(float, (data.draw(st.integers(0, 4)), len(decimals)), elements=numbers))
    assert rows_text(values, decimals) == by_operator(values, decimals)


@pytest.mark.parametrize("neighbour", [-np.inf, 0, np.inf])
def test_numbers_beside_the_middle_between_two_texts(neighbour):
    """Scaled by a power of ten, many of them are on the other side of it."""
    halves = (np.arange(-9999, 9999, 2) * 10.0 ** np.arange(0, 8)[:, None] + 1).ravel() / 2e6
    values = halves if neighbour == 0 else np.nextafter(halves, neighbour)
    assert rows_text(values[:, None], [6]) == by_operator(values[:, None], [6])


def test_every_number_of_digits():
    powers = 10.0 ** np.arange(-8, 12)
    values = np.concatenate([powers, powers - 1, -powers])[:, None]
    for places in range(1, 12):
        assert rows_text(values, [places]) == by_operator(values, [places])


def test_rows_without_columns_are_empty_lines():
    assert rows_text(np.zeros((2, 0)), []) == "\n\n"
