"""Contact files: what they say comes back, and what is wrong with one is told in a line with its place."""

import json

import pytest
from bodies import sample
from schemas import validator

from distretarget import (
    Contact,
    ContactList,
    Distance,
    DistretargetError,
    Look,
    Plant,
    SettingsError,
    load_contacts,
    retarget,
)
from distretarget.io.contacts_file import contacts_to_json, parse_contacts

ENTRIES = (
    Contact(between=("left hand", "hips"), frames=(10.0, 20.0)),
    Contact(between=("left hand", "hips"), frames=(10.0, 20.0), keep=False),
    Contact(between=("left hand", "head"), gap=2.5, firmness=0.5, seconds=(0.5, 1.25)),
    Contact(between=("left hand", "head"), gap="source"),
    Contact(between=("left hand", "head"), gap=1.0, anchors=((0.5, 0.0), (0.75, -12.5))),
    Plant(plant="left foot", on="floor", frames=(0.0, 5.0)),
    Plant(plant="left hand", on=(1.0, 2.0, 3.5)),
    Plant(plant="right foot", keep=False, found="planted"),
    Distance(distance=("LeftWrist", "Head"), value=12.0, priority=3.0),
    Look(look="head", like=(0.0, 0.0, 1.0)),
    Look(look="left hand"),
)
WRONG = [
    ("{", "line 1, column 2: is not valid JSON: Expecting property name enclosed in double quotes"),
    ([], "expected an object, found a list of 0"),
    (
        {"format": "distretarget-map", "version": 1, "contacts": []},
        "format: expected \"distretarget-contacts\", found 'distretarget-map'",
    ),
    ({"version": 2}, "version: expected 1, found 2"),
    ({"contact": []}, "contact: unknown key; did you mean 'contacts'?"),
    ({"contacts": {}}, "contacts: expected a list, found an object"),
    (
        {"betwen": ["left hand", "hips"], "keep": False},
        'contacts[0]: expected one of "between", "plant", "distance" and "look", found none of them; '
        "'betwen' is no key: did you mean 'between'?",
    ),
    (
        {"plant": "left hand", "look": "head"},
        'contacts[0]: expected one of "between", "plant", "distance" and "look", found "plant" and "look"',
    ),
    (
        {"between": ["left hand"], "keep": False},
        "contacts[0]: between is ('left hand',); expected the names of two parts or joints",
    ),
    ({"between": ["left hand", "hips"]}, 'contacts[0]: says nothing; expected "keep" or "gap"'),
    ({"between": ["left hand", "hips"], "keep": "no"}, "contacts[0]: keep is 'no'; expected a bool"),
    ({"between": ["left hand", "hips"], "gap": -1}, "contacts[0]: gap is -1.0; expected a number from 0 to 1e+09"),
    (
        {"between": ["left hand", "hips"], "gap": "source", "anchors": [[0.5, 0], [0.5, 0]]},
        'contacts[0]: anchors are the places of a gap; expected "gap" beside them, in centimetres',
    ),
    (
        {"between": ["left hand", "hips"], "gap": 0, "anchors": [[0.5, 0]]},
        "contacts[0]: anchors are ((0.5, 0.0),); expected two, one of each part",
    ),
    (
        {"between": ["left hand", "hips"], "gap": 0, "anchors": [[0.5, 0], [0.5]]},
        "contacts[0]: anchors[1] is (0.5,); expected 2 numbers",
    ),
    ({"between": {}, "keep": False}, "contacts[0]: between is (); expected the names of two parts or joints"),
    ({"look": "head", "like": [0, 0, [1]]}, "contacts[0]: like is (1.0,); expected a number"),
    (
        {"between": ["left hand", "hips"], "gap": 0, "frames": [20, 10]},
        "contacts[0]: frames go back from 20 to 10; swap them",
    ),
    (
        {"between": ["left hand", "hips"], "gap": 0, "frames": [2.5, 10]},
        "contacts[0]: frames go from 2.5 to 10; expected whole numbers, or seconds",
    ),
    (
        {"between": ["left hnad", "hips"], "keep": False},
        "contacts[0].between[0]: no part or joint 'left hnad'; did you mean 'left hand'",
    ),
    (
        {"between": ["left hand", "hips"], "gap": 0, "frames": [200, 400]},
        "contacts[0].frames: frame 400 is beyond the clip, which has 277 frames, 0 to 276",
    ),
    (
        {"between": ["left hand", "hips"], "gap": 0, "seconds": [4, 9]},
        "contacts[0].seconds: 9 s is beyond the clip, which lasts 4.61676 s",
    ),
    (
        {"between": ["left hand", "left forearm"], "gap": 0},
        "contacts[0].between: 'left hand', 'left forearm' are neighbours, which always touch",
    ),
    (
        {"distance": ["LeftWrist", "Head"], "value": 500},
        "contacts[0].value: no posture has 'LeftWrist', 'Head' 500 cm apart; their bones allow",
    ),
    ({"distance": ["LeftWrist", "Haed"], "value": 5}, "contacts[0].distance[1]: no joint 'Haed'; did you mean 'Head'"),
    ({"look": "trunk"}, "contacts[0].look: 'trunk' carries other parts; expected the head, a hand or a foot"),
    (
        {"plant": "left hand", "on": "wall"},
        "contacts[0].on: no joint or prop 'wall'; it has 'floor', 'where it is', 'left hand', 'right hand', 'head'",
    ),
    (
        {"plant": "left hand", "on": "LeftWrist"},
        "contacts[0].on: 'left hand', 'LeftWrist' are the same part of the body",
    ),
]


def document(*entries):
    return {"format": "distretarget-contacts", "version": 1, "contacts": [*entries]}


def test_what_is_written_is_read_back_and_suits_the_schema():
    text = contacts_to_json(ContactList(ENTRIES))
    assert parse_contacts(text, "x.json").entries == ENTRIES
    validator("io/contacts").validate(json.loads(text))
    assert not parse_contacts(contacts_to_json(ContactList()), "x.json").entries


@pytest.mark.parametrize(("content", "message"), WRONG, ids=[message[:40] for _, message in WRONG])
def test_what_a_wrong_file_prints(tmp_path, content, message):
    """The table of wrong files: each is told in one line, with the place in the file."""
    path = tmp_path / "walk.contacts.json"
    if isinstance(content, dict) and "format" not in content:
        known = {"version", "contact", "contacts"} & content.keys()
        content = document() | content if known else document(content)
        if "contact" in content:
            del content["contacts"]
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    with pytest.raises(DistretargetError) as raised:
        retarget(sample("clap"), sample("clap").skeleton, contacts=load_contacts(path))
    assert "\n" not in str(raised.value)
    assert str(raised.value).startswith(f"{path}: {message}")


def test_two_entries_that_contradict_each_other_name_both():
    one = Contact(between=("left hand", "head"), gap=0.0, frames=(0, 20))
    other = Contact(between=("head", "left hand"), keep=False, frames=(20, 40))
    says = r"contacts\[1\]: contradicts contacts\[0\]: both are about 'head', 'left hand' in frame 20"
    with pytest.raises(DistretargetError, match=says):
        retarget(sample("clap"), sample("clap").skeleton, contacts=ContactList((one, other)))


@pytest.mark.parametrize(
    ("kind", "values", "what"),
    [
        (Contact, {"between": ("hips", "hips")}, "between names 'hips' twice"),
        (Contact, {"between": ("hips", "head"), "gap": -1.0}, "gap is -1.0"),
        (Contact, {"between": ("hips", "head"), "keep": False, "gap": 1.0}, "keep false drops a contact"),
        (Contact, {"between": ("hips", "head"), "firmness": 0.5}, "firmness is the weight of a gap"),
        (Plant, {"plant": "hips", "on": (0.0, 1.0)}, "on is"),
        (Plant, {"plant": "hips", "on": "floor", "keep": False}, "keep false drops a support"),
        (Look, {"look": "head", "like": (0.0, 0.0, 0.0)}, "which is no direction"),
        (Look, {"look": "head", "frames": (9.0, 3.0)}, "frames go back from 9 to 3"),
        (Look, {"look": "head", "frames": (0.0, 3.0), "seconds": (0.0, 1.0)}, "both frames and seconds"),
        (Distance, {"distance": ("a", "b"), "value": -1.0}, "value is -1.0"),
    ],
)
def test_entries_are_checked(kind, values, what):
    with pytest.raises(SettingsError, match=what):
        kind(**values)
