"""BVH files: what is accepted, what is refused and where."""

import itertools
import re
import tempfile
import warnings
from pathlib import Path

import numpy as np
import pytest
from bodies import CORPUS, needs_corpus
from bvh_texts import HIERARCHY, JOINTS, MOTION, TEXT, assert_same, edit, format_bvh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from test_corpus import REFUSED as REFUSED_OF_CORPUS

from distretarget.errors import BvhError, DistretargetError
from distretarget.io.bvh import parse_bvh, parse_bvh_skeleton, read_bvh
from distretarget.io.files import read_text
from distretarget.motion import Motion

ROWS = MOTION.splitlines()[3:]


def skeleton_of(path):
    return parse_bvh_skeleton(read_text(path), path)


def put(text, name="a.bvh"):
    """A file of this text, bytes or str, in a new folder."""
    path = Path(tempfile.mkdtemp(), name)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.fixture(autouse=True)
def _scratch(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


def read(text):
    return read_bvh(put(text))


def naive_positions(text):
    """Joint positions (frames, joints, 3) of TEXT by one matrix product a channel."""
    values = iter(" ".join(text.splitlines()[-3:]).split())
    frames = []
    for _ in range(3):
        turn = {"": np.eye(3)}
        place = {"": np.zeros(3)}
        for name, parent, offset, channels in (
            ("Hips", "", [1, 2, 3], "xyzZXY"),
            ("Chest", "Hips", [0, 5.25, 0.1], "YXZ"),
            ("Head", "Chest", [0, 4, 0], "XY"),
            ("Head_End", "Head", [0, 1, 0.5], ""),
            ("Leg", "Hips", [0.5, -3, 0], "X"),
            ("Leg_End", "Leg", [0, -4, 1], ""),
        ):
            translation, rotation = np.array(offset, float), np.eye(3)
            for channel in channels:
                value = float(next(values))
                if channel in "xyz":
                    translation["xyz".index(channel)] = value
                else:
                    axis = np.eye(3)["XYZ".index(channel)]
                    rotation = rotation @ Rotation.from_rotvec(np.radians(value) * axis).as_matrix()
            place[name] = place[parent] + turn[parent] @ translation
            turn[name] = turn[parent] @ rotation
        frames.append([place[name] for name in JOINTS])
    return np.array(frames)


def test_reading():
    motion = read(TEXT)
    assert motion.skeleton.names == JOINTS
    assert motion.skeleton.parents.tolist() == [-1, 0, 1, 2, 0, 4]
    assert motion.skeleton.end_sites.tolist() == [False, False, False, True, False, True]
    assert motion.skeleton.channels[0][2:5] == ("Zposition", "Zrotation", "Xrotation")
    assert motion.skeleton.channels[2:] == (("Xrotation", "Yrotation"), (), ("Xrotation",), ())
    assert motion.skeleton.offsets[1].tolist() == [0.0, 5.25, 0.1]
    assert motion.frame_time_text == "0.0333333"
    np.testing.assert_allclose(motion.positions, naive_positions(TEXT), atol=1e-12)


SAME = {
    "CRLF": TEXT.replace("\n", "\r\n"),
    "bare CR": TEXT.replace("\n", "\r"),
    "mixed line ends": edit(("\n", "\r\n"), ("Hips\n", "Hips\r"), ("{\n", "{\r\n")),
    "tabs": TEXT.replace("  ", "\t").replace(" ", "\t").replace("End\tSite", "End Site"),
    "byte order mark": b"\xef\xbb\xbf" + TEXT.encode(),
    "UTF-16": TEXT.encode("utf-16"),
    "Ctrl-Z": TEXT + "\x1a",
    "exponents": edit((" 5.25 ", " +52.5e-1 "), ("10.25", "1.025E1"), ("0.1\n", ".1\n"), ("370", "370.")),
    "brace on the line": re.sub(r"\n *\{", " {", TEXT),
    "brace at the name": re.sub(r"\n *\{", "{", TEXT),
    "hierarchy on one line": re.sub(r"\s+", " ", HIERARCHY.replace("\n", " ")) + MOTION,
    "everything on one line": re.sub(r"\s+", " ", re.sub(r"\n *\{", " {", TEXT)),
    "upper case": HIERARCHY.upper().replace("HIPS", "Hips").replace("CHEST", "Chest").replace("HEAD", "Head")
    .replace("LEG", "Leg") + MOTION.upper(),
    "lower case": re.sub("[A-Z]+ |HIERARCHY|MOTION|End", lambda word: word.group().lower(), TEXT),
    "channel case": TEXT.replace("Xrotation", "xROTATION").replace("Yposition", "YPosition"),
    "wrapped rows": HIERARCHY + "\n".join(MOTION.splitlines()[:3]) + "\n" + "\n".join(" ".join(ROWS).split()),
    "frames on one line": HIERARCHY + "\n".join(MOTION.splitlines()[:3]) + "\n" + " ".join(ROWS),
    "blank lines": TEXT.replace("\n", " \n\n \t\n"),
    "no final newline": TEXT.rstrip(),
    "trailing blanks": TEXT.replace("\n", "  \n") + " \n\n\n",
    "tab after Frames": edit(("Frames: 3", "Frames:\t3")),
    "no blank after Frames": edit(("Frames: 3", "Frames:3"), ("Time: ", "Time:")),
    "blanks in Frame Time": edit(("Frame Time: ", "FRAME \t time  :\n")),
    "named End Site": edit(("End Site", "End LeftToe")),
}  # fmt: skip


@pytest.mark.parametrize("text", SAME.values(), ids=SAME.keys())
def test_the_same_motion_in_other_words(text):
    assert_same(read(text), read(TEXT))


@pytest.mark.parametrize(
    "name", ["mixamorig:Hips", "Bip01  Pelvis L", "a.b-c_d", "腰", "JOINT", "End Site", "Ünï\xa0", "x\u2028y"]
)
@pytest.mark.parametrize("brace", ["\n{", " {", "{"])
def test_names_are_kept(name, brace):
    motion = read(edit((" Hips\n{", f" \t{name} {brace}")))
    assert motion.skeleton.names[0] == name
    assert_same(read(format_bvh(motion)), motion, 1e-6)


def test_end_sites_get_names_that_nobody_has():
    sites = "End Site {OFFSET 0 0 0} End Site {OFFSET 1 2 3} JOINT Head_End2 {OFFSET 0 1 0} End Site"
    skeleton = read(edit(("End Site", sites))).skeleton
    assert skeleton.names[2:7] == ("Head", "Head_End", "Head_End3", "Head_End2", "Head_End4")
    assert skeleton.parents.tolist()[2:7] == [1, 2, 2, 2, 2]
    assert skeleton.offsets[3:5].tolist() == [[0, 0, 0], [1, 2, 3]]
    assert skeleton.end_sites.tolist()[2:7] == [False, True, True, False, True]
    motion = read(re.sub(r"\s*End Site\s*\{[^}]*\}", "", TEXT))
    assert motion.skeleton.names == ("Hips", "Chest", "Head", "Leg")
    np.testing.assert_allclose(motion.positions, naive_positions(TEXT)[:, [0, 1, 2, 4]], atol=1e-12)


@pytest.mark.parametrize("line", ["", "CHANNELS 0\n"])
def test_joints_without_channels(line):
    fixed = f"JOINT Fixed\n{{\nOFFSET 0 1 0\n{line}JOINT Head"
    text = edit(("JOINT Head", fixed), ("      }\n", "      }\n}\n"))
    motion = read(text)
    assert motion.skeleton.channels[motion.skeleton.index("Fixed")] == ()
    np.testing.assert_allclose(motion.rotations[:, 2], np.tile([0, 0, 0, 1], (3, 1)), atol=0)
    assert_same(read(format_bvh(motion)), motion, 1e-6)


@pytest.mark.parametrize("order", ["".join(axes) for n in range(4) for axes in itertools.permutations("XYZ", n)])
@pytest.mark.parametrize("slides", ["", "Y", "ZX"])
def test_any_channels_in_any_order(order, slides):
    names = [f"{axis}rotation" for axis in order]
    names[1:1] = [f"{axis}position" for axis in slides]
    row = [10.0 * (column + 1) for column in range(len(names))]
    text = "\n".join([
        "HIERARCHY", "ROOT a", "{", "OFFSET 0 0 0", "CHANNELS 1 Yrotation", "JOINT b", "{", "OFFSET 1 2 3",
        f"CHANNELS {len(names)} {' '.join(names)}", "}", "}", "MOTION", "Frames: 1", "Frame Time: 1",
        " ".join(map(str, [0, *row])),
    ])  # fmt: skip
    motion = read(text)
    turned = Rotation.identity()
    translation = np.array([1.0, 2.0, 3.0])
    for name, value in zip(names, row, strict=True):
        if name.endswith("position"):
            translation["XYZ".index(name[0])] = value
        else:
            turned = turned * Rotation.from_euler(name[0], value, degrees=True)
    np.testing.assert_allclose(motion.translations[0, 1], translation, atol=0)
    assert (Rotation.from_quat(motion.rotations[0, 1]).inv() * turned).magnitude() < 1e-12
    assert motion.skeleton.channels[1] == tuple(names)
    assert_same(read(format_bvh(motion)), motion, 1e-6)


def test_no_frames():
    motion = read(HIERARCHY + "MOTION\nFrames: 0\nFrame Time: .0083333\n\n")
    assert len(motion) == 0
    assert motion.frame_time_text == ".0083333"
    assert_same(read(format_bvh(motion)), motion)


REFUSED = {
    "no hierarchy": (edit(("HIERARCHY\n", "")), 1, "'ROOT'", "HIERARCHY"),
    "no joints": ("HIERARCHY\nMOTION\nFrames: 0\nFrame Time: 1\n", 2, "'MOTION'", "ROOT"),
    "no root": (edit(("ROOT", "JOINT")), 2, "'JOINT'", "ROOT"),
    "nameless": (edit(("ROOT Hips", "ROOT")), 3, "'{'", "a name"),
    "no opening brace": (edit(("Chest\n  {", "Chest\n")), 8, "'OFFSET'", "{"),
    "no closing brace": (edit(("}\nMOTION", "MOTION")), 29, "'MOTION'", "}"),
    "brace too many": (edit(("}\nMOTION", "}\n}\nMOTION")), 30, "'}'", "MOTION"),
    "words before MOTION": (edit(("MOTION", "\nhello\nMOTION")), 31, "'hello'", "MOTION"),
    "second root": (edit(("MOTION", "ROOT b\n{\nOFFSET 0 0 0\n}\nMOTION")), 30, "second ROOT", "MOTION"),
    "no offset": (edit(("    OFFSET 0.0 5.25 0.1\n", "")), 8, "'CHANNELS'", "OFFSET"),
    "offset of two": (edit((" 5.25 0.1", " 5.25")), 9, "'CHANNELS'", "the z offset, a finite number"),
    "offset of four": (edit((" 5.25", " 5.25 6")), 8, "'0.1'", "JOINT"),
    "offset of text": (edit((" 5.25", " 5,25")), 8, "'5,25'", "the y offset, a finite number"),
    "offset not finite": (edit((" 5.25", " 1e999")), 8, "'1e999'", "the y offset, a finite number"),
    "offset too large": (edit((" 5.25", " -1e13")), 8, "'-1e13'", "the y offset, a finite number, at most 1e+12"),
    "offset of End Site": (edit(("        OFFSET 0.0 1.0 0.5\n", "")), 16, "'}'", "OFFSET"),
    "unknown channel": (edit(("Yrotation\n  JOINT", "Wrotation\n  JOINT")), 5, "'Wrotation'", "Xposition"),
    "repeated channel": (edit(("Zposition", "XPOSITION")), 5, "'XPOSITION' twice", "each channel once"),
    "channels too few": (edit(("Xposition ", "")), 5, "5 channel names", "6 as declared"),
    "channels too many": (edit(("S 6", "S 5")), 5, "6 channel names", "5 as declared"),
    "channels uncounted": (edit(("S 6", "S")), 5, "'Xposition'", "the number of channels"),
    "channels twice": (edit(("S 1", "S 1 Zrotation\nCHANNELS 1")), 24, "'CHANNELS'", "JOINT or End Site"),
    "channels of End Site": (edit(("1.0 0.5", "1.0 0.5\nCHANNELS 0")), 17, "'CHANNELS'", "}"),
    "joint in End Site": (edit(("1.0 0.5", "1.0 0.5\nJOINT x\n{\nOFFSET 0 0 0\n}")), 17, "'JOINT'", "}"),
    "twins": (edit(("Leg", "Chest")), 20, "'Hips/Chest'", "rename"),
    "no Frames": (edit(("Frames: 3\n", "")), 31, "'Frame'", "Frames:"),
    "no frame count": (edit(("Frames: 3", "Frames:")), 32, "'Frame'", "the number of frames, a whole number"),
    "negative frame count": (edit(("Frames: 3", "Frames: -3")), 31, "'-3'", "a whole number"),
    "fraction of frames": (edit(("Frames: 3", "Frames: 3.0")), 31, "'3.0'", "a whole number"),
    "endless frame count": (edit(("Frames: 3", "Frames: " + "9" * 9999)), 31, "'9999", "a whole number"),
    "huge frame count": (edit(("Frames: 3", "Frames: 999999999999")), 31, "3 whole frames", "999999999999"),
    "frames too few": (edit(("Frames: 3", "Frames: 5")), 31, "3 whole frames of 12 numbers", "5 frames"),
    "frames too many": (edit(("Frames: 3", "Frames: 1")), 31, "3 whole frames", "1 frames as declared"),
    "short row": (edit((" 885", "")), 31, "2 whole frames of 12 numbers and 11 numbers over", "3 frames"),
    "no frame time": (edit(("Frame Time: 0.0333333\n", "")), 32, "'0'", "Frame Time:"),
    "frame time 0": (edit(("0.0333333", "0.0")), 32, "'0.0'", "a number above 0"),
    "frame time underflow": (edit(("0.0333333", "1e-999")), 32, "'1e-999'", "a number above 0"),
    "frame time negative": (edit(("0.0333333", "-.1")), 32, "'-.1'", "a number above 0"),
    "frame time too short": (edit(("0.0333333", "1e-9")), 32, "'1e-9'", "above 0, from 1e-05 to 1000"),
    "frame time too long": (edit(("0.0333333", "1e308")), 32, "'1e308'", "above 0, from 1e-05 to 1000"),
    "frame time text": (edit(("0.0333333", "1/30")), 32, "'1/30'", "a number above 0"),
    "frame time infinite": (edit(("0.0333333", "inf")), 32, "'inf'", "a number above 0"),
    "text in frames": (edit(("13 70", "13 abc 70")), 34, "'abc'", "a finite number"),
    "text after frames": (TEXT + "the end\n", 36, "'the'", "a finite number, at most 1e+12, or the end of the file"),
    "nan": (edit(("13 70", "nan 70")), 34, "'nan'", "a finite number"),
    "infinity": (edit(("13 885", "-Infinity 885")), 35, "'-Infinity'", "a finite number"),
    "overflow": (edit(("13 885", "1e999 885")), 35, "'1e999'", "a finite number"),
    "position of no body": (edit(("13 885", "1e308 885")), 35, "'1e308'", "a finite number, at most 1e+12"),
    "two dots": (edit(("12 13 70", "1.2.3 70")), 34, "'1.2.3'", "a finite number"),
    "glued numbers": (edit(("12 13 70", "12-13 70")), 34, "'12-13'", "a finite number"),
    "underscore": (edit(("12 13 70", "12 1_3 70")), 34, "'1_3'", "a finite number"),
    "other digits": (edit(("12 13 70", "12 \u0661 70")), 34, "'\u0661'", "a finite number"),
    "line counted over CR": (edit(("13 70", "nan 70")).replace("\n", "\r"), 34, "'nan'", "finite"),
    "line counted over CRLF": (edit(("13 70", "nan 70")).replace("\n", "\r\n"), 34, "'nan'", "finite"),
    "too deep": (
        "HIERARCHY\n" + "".join(f"{'JOINT' if n else 'ROOT'} n{n} {{\nOFFSET 0 0 0\n" for n in range(5000)),
        804, "inside 401 others", "400 at most",
    ),
    "frames without channels": (
        "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\n}\nMOTION\nFrames: 99999999999\nFrame Time: 1\n",
        7, "99999999999", "expected 0",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("text", "line", "found", "expected"), REFUSED.values(), ids=REFUSED.keys())
def test_refusals_name_line_and_what_was_found_and_expected(text, line, found, expected):
    path = put(text)
    with pytest.raises(BvhError) as caught:
        read_bvh(path)
    assert (caught.value.path, caught.value.line) == (path, line)
    assert found in caught.value.reason
    assert expected in caught.value.reason
    assert len(str(caught.value).splitlines()) == 1
    assert len(caught.value.reason) < 250


WORDS = [match.end() for match in re.finditer(r"\S+", TEXT)]
NOT_WHOLE = [
    end for end in WORDS[:-1] if end != WORDS[-1 - len(ROWS[-1].split())]
]  # without that of the last frame but one


@pytest.mark.parametrize("end", NOT_WHOLE, ids=lambda end: repr(TEXT[:end].split()[-1]) + f" {end}")
def test_files_that_end_early(end):
    with pytest.raises(BvhError) as caught:
        read(TEXT[:end] + "\n\n")
    in_frames = "whole frames" in caught.value.reason
    assert in_frames or re.search("the file ends|channel names, expected|'Frame'", caught.value.reason)
    assert caught.value.line == (31 if in_frames else TEXT[:end].count("\n") + 1)


def test_reading_needs_no_temporary_file(monkeypatch):
    path = put(TEXT)
    monkeypatch.setattr(tempfile, "tempdir", str(path))  # a file: nothing can be made in it
    assert read_bvh(path).skeleton.names == JOINTS


@pytest.mark.parametrize("motion", ["", "MOTION", "MOTION\nFrames: x", MOTION.replace("10", "?"), MOTION + "1 2"])
def test_a_skeleton_needs_no_motion(motion):
    skeleton = skeleton_of(put(HIERARCHY + motion))
    assert skeleton.names == JOINTS
    assert skeleton.offsets.tolist() == read(TEXT).skeleton.offsets.tolist()


def test_a_skeleton_needs_a_whole_hierarchy():
    with pytest.raises(BvhError, match="expected MOTION"):
        skeleton_of(put(HIERARCHY + "MOTIN\n"))
    with pytest.raises(BvhError, match="the file ends, expected JOINT or End Site or }"):
        skeleton_of(put(HIERARCHY.rstrip().removesuffix("}")))
    joints = [f"{'JOINT' if n else 'ROOT'} n {{\nOFFSET 0 1 0\n" for n in range(401)]
    text = "HIERARCHY\n" + "".join(joints) + "}" * 401
    assert len(skeleton_of(put(text))) == 401


SLIDING = edit(
    ("S 1 Xrotation", "S 2 Yposition Xrotation"),
    ("0 0\n0.5", "0 -3 0\n0.5"),
    ("13 70", "13 -7 70"),
    ("13 885", "13 -8 885"),
)


def test_bones_of_joints_that_slide_come_from_the_frames():
    path = put(SLIDING)
    skeleton = skeleton_of(path)
    np.testing.assert_array_equal(skeleton.offsets, read_bvh(path).rigid_skeleton.offsets)
    np.testing.assert_allclose(skeleton.lengths[4], np.hypot(0.5, 7))
    assert skeleton_of(put(SLIDING[: SLIDING.index("MOTION")])).offsets[4].tolist() == [0.5, -3, 0]
    with pytest.raises(BvhError, match="whole frames"):
        skeleton_of(put(SLIDING.replace("Frames: 3", "Frames: 5")))


def outcome(content):
    """The motion, or the error; anything else fails."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of a frame more or less
            result = read(content)
    except DistretargetError as error:
        result = error
    if isinstance(result, Motion):
        assert np.all(np.isfinite(result.rotations))
        assert np.all(np.isfinite(result.translations))
    else:
        assert len(str(result).splitlines()) == 1
    return result


@settings(max_examples=250)
@given(st.integers(0, len(TEXT) - 1), st.integers(0, 255))
def test_fuzz_one_byte(at, byte):
    content = bytearray(TEXT.encode())
    content[at] = byte
    outcome(bytes(content))


@settings(max_examples=100)
@given(st.lists(st.tuples(st.integers(0, TEXT.count("\n")), st.integers(0, TEXT.count("\n"))), min_size=1, max_size=3))
def test_fuzz_lines_moved_or_lost(moves):
    lines = TEXT.splitlines()
    for source, target in moves:
        line = lines.pop(source % len(lines))
        if target % 2:
            lines.insert(target, line)
    outcome("\n".join(lines))


@pytest.mark.parametrize("word", ["1" * 100_000 + "x", "." * 100_000, "1e" * 50_000, "{" * 100_000])
def test_long_words_take_no_longer(word):
    for place in ("5.25", "0.0333333", "885"):
        error = outcome(edit((place, word)))
        assert isinstance(error, BvhError)
        assert len(error.reason) < 250


def test_many_joints_take_no_longer():
    sites = "End Site\n{\nOFFSET 0 0 0\n}\n" * 5000
    twins = "JOINT a\n{\nOFFSET 0 0 0\n}\n" * 5000
    assert len(outcome(edit(("End Site", sites + "End Site"))).skeleton) == 5006
    assert "'Hips/Chest/Head/a'" in outcome(edit(("End Site", twins + "End Site"))).reason


FILES = sorted(CORPUS.rglob("*.bvh")) if CORPUS.is_dir() else []
SOUND = [path for path in FILES if path.name not in REFUSED_OF_CORPUS or path.stem == "odd_frames_0"]

PYBVH_CANNOT = {
    "makehuman/benchmark": "position channels below the root",
    "makehuman/tpose": "position channels below the root",
    "synthetic_odd/odd_pos_on_every_joint": "position channels below the root",
    "synthetic_odd/odd_dup_names": "names that are not unique",
    "synthetic_odd/odd_names_spaces": "names with spaces",
    "synthetic_odd/odd_lower_case_keywords": "lower case",
    "synthetic_odd/odd_joint_without_channels": "joints without channels",
    "synthetic_odd/odd_motion_one_line": "frames on one line",
    "synthetic_odd/odd_frames_0": "no frames",
}


def corpus(paths):
    return pytest.mark.parametrize("path", paths, ids=lambda path: f"{path.parent.name}/{path.name}")


def cut(path, tmp_path, frames=30):
    """A copy of the file with its first frames only, if it has that many."""
    head, count, rest = re.split(rb"(?i)Frames:\s*(\d+)", path.read_bytes(), maxsplit=1)
    if int(count) <= frames:
        return path
    rows = re.split(rb"\r\n|\r|\n", rest)
    (tmp_path / path.name).write_bytes(head + b"Frames: %d" % frames + b"\n".join(rows[: frames + 2]) + b"\n")
    return tmp_path / path.name


@needs_corpus
@corpus(SOUND)
def test_corpus_round_trip(path, tmp_path):
    motion = read_bvh(cut(path, tmp_path))
    size = motion.skeleton.longest_path
    assert_same(read(format_bvh(motion)), motion, 1e-6 * size)


@needs_corpus
@corpus([path for path in SOUND if f"{path.parent.name}/{path.stem}" not in PYBVH_CANNOT])
def test_corpus_positions_agree_with_pybvh(path, tmp_path):
    import pybvh

    path = cut(path, tmp_path)
    motion = read_bvh(path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reading = pybvh.read_bvh_file(path)
    joints = np.flatnonzero(~motion.skeleton.end_sites)
    rows = [reading.joint_index[motion.skeleton.names[joint]] for joint in joints]
    expected = reading.joint_positions()[:, rows]
    size = motion.skeleton.longest_path
    np.testing.assert_allclose(motion.positions[:, joints], expected, rtol=0, atol=1e-6 * size)
    tips = motion.positions[:, motion.skeleton.end_sites]
    nodes = [row for name, row in reading.node_index.items() if name not in reading.joint_index]
    assert len(nodes) == tips.shape[1]
    np.testing.assert_allclose(tips, reading.node_positions()[:, nodes], rtol=0, atol=1e-6 * size)


def test_position_channels_of_noise_do_not_collapse_the_body():
    text = """HIERARCHY
ROOT a
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT b
  {
    OFFSET 0 10 0
    CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
    JOINT c
    {
      OFFSET 0 5 0
      CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
    }
  }
}
MOTION
Frames: 1
Frame Time: 0.1
0 90 0 0 0 0 0.0001 0 0 0 0 0 0 0 -0.0001 0 0 0
"""
    np.testing.assert_allclose(read(text).positions[0, :, 1], [90, 100, 105])
    real = text.replace("0.0001 0 0 0 0 0", "1 9 0 0 0 0")
    np.testing.assert_allclose(read(real).positions[0, :, 1], [90, 99, 99], atol=1e-3)


@pytest.mark.parametrize("declared", [2, 4])
def test_whole_frames_are_read_if_one_more_or_less_is_declared(declared, tmp_path):
    path = tmp_path / "clip.bvh"
    path.write_text(edit(("Frames: 3", f"Frames: {declared}")), "utf-8")
    with pytest.warns(UserWarning, match=f"the file declares {declared} frames and has 3; these are read"):
        motion = read_bvh(path)
    assert_same(motion, parse_bvh(TEXT, "clip.bvh"))


@pytest.mark.parametrize("milliseconds", ["33.333", "8.3333", "16.6667"])
def test_a_frame_time_in_milliseconds_is_doubted(milliseconds, tmp_path):
    path = tmp_path / "clip.bvh"
    path.write_text(re.sub(r"Frame Time:\s*\S+", f"Frame Time: {milliseconds}", TEXT), "utf-8")
    rate = f"{1000 / float(milliseconds):.4g} frames/s"
    with pytest.warns(UserWarning, match=f"in milliseconds it would be {rate}"):
        assert read_bvh(path).frame_time_text == milliseconds
