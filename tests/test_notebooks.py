"""What notebooks and `help` show, and frames taken by number."""

import pydoc
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from bodies import SAMPLES, person, swaying

import distretarget as d
from distretarget.stick_figures import likely_up, stick_figures


def pictures(page):
    """The coordinates of all bones in the pictures of a page, (bones, 2, 2)."""
    root = ET.fromstring(f"<page>{page}</page>")
    lines = [line for path in root.iter("path") for line in path.attrib["d"].split("M")[1:]]
    return np.array([[list(map(float, end.split())) for end in line.split("L")] for line in lines])


def test_a_motion_a_skeleton_and_a_result_have_pictures():
    clip = d.read_bvh(SAMPLES / "clap.bvh")
    result = d.retarget(clip, d.load_target(SAMPLES / "long_arms.json"))
    bones = len(clip.skeleton) - 1
    assert len(pictures(clip.skeleton._repr_html_())) == bones
    assert len(pictures(clip[:3]._repr_html_())) == 3 * bones
    page = result._repr_html_()
    assert len(pictures(page)) == 7 * bones
    assert result.verdict in page
    assert "contact error" in page
    assert "<svg" not in clip[:0]._repr_html_()


@pytest.mark.parametrize("up", ["Y", "Z", "-Y"])
def test_heads_are_on_top_in_pictures(up):
    parents, posture = np.array([-1, 0]), np.zeros((2, 3))
    posture[1, "XYZ".index(up[-1])] = -1.7 if up[0] == "-" else 1.7
    (foot, head), *_ = pictures(stick_figures(parents, posture[None], likely_up(posture, up), "<a> & b"))
    assert head[1] < foot[1]


def test_one_frame_by_its_number_and_all_in_turn():
    clip = swaying(person(), frames=4)
    np.testing.assert_array_equal(clip[-1].rotations, clip.rotations[3:])
    assert len(clip[np.int64(1)]) == 1
    assert [len(frame) for frame in clip] == [1, 1, 1, 1]
    for wrong in (4, -5, "a"):
        with pytest.raises(IndexError):
            clip[wrong]


@pytest.mark.parametrize("name", d.__all__)
def test_help_shows_no_addresses(name):
    assert " at 0x" not in pydoc.render_doc(getattr(d, name))


def test_settings_show_what_differs_from_the_defaults():
    assert repr(d.Options()) == "Options()"
    assert repr(d.Options(skin="none")) == "Options(skin='none')"
    assert repr(d.ContactSettings(reach=0.1)) == "ContactSettings(reach=0.1)"
