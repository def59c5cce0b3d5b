# SPDX-License-Identifier: GPL-3.0-or-later
"""What is to become of the contacts of clips: entries of contact files, kept in the scene and shown as markers.

An entry is kept as the text that a contact file has for it; the properties of the panel read and change that text.
"""

import itertools
import json
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty, StringProperty

Entry = dict[str, Any]
SUBJECTS = ("between", "plant", "look", "distance")  # the fields that say what an entry is about
SAID = ("keep", "gap", "firmness", "on")  # the fields that say what becomes of it
STATES = {  # by subject, what may become of it: its name, and what the panel shows
    "between": [
        ("FOUND", "As found", "It is kept as far as it is found in the clip"),
        ("DROP", "Drop", "These parts need not touch"),
        ("SOURCE", "Hold as in the clip", "The skins are as far apart as in the clip"),
        ("GAP", "Hold at a gap", "The skins are as far apart as the gap says"),
    ],
    "plant": [
        ("FOUND", "As found", "It rests as far as it is found to rest in the clip"),
        ("DROP", "Let go", "It need not rest"),
        ("FLOOR", "On the floor", "It rests on the floor"),
        ("HERE", "Where it is", "It stays at its mean place"),
        ("THERE", "On what the file says", "It rests on a place, a joint or a prop that a contact file names"),
    ],
    "look": [("ASKED", "Ask for it", "A direction that a contact file asks for")],
    "distance": [("ASKED", "Ask for it", "A distance that a contact file asks for")],
}
CHANGES = {  # what an entry says, by state
    "FOUND": {"keep": True},
    "DROP": {"keep": False},
    "SOURCE": {"gap": "source"},
    "GAP": {"gap": 0.0},
    "FLOOR": {"on": "floor"},
    "HERE": {"on": "where it is"},
}


def subject_of(entry: Entry) -> str:
    return next(each for each in SUBJECTS if each in entry)


def title_of(entry: Entry) -> str:
    """What an entry is about, in words."""
    named = entry[subject_of(entry)]
    return named if isinstance(named, str) else " - ".join(named)


def state_of(entry: Entry) -> str:
    """What is to become of it; where it is "FOUND", the entry changes nothing."""
    if subject_of(entry) in ("look", "distance"):
        return "ASKED"
    if entry.get("keep") is False:
        return "DROP"
    if "gap" in entry:
        return "SOURCE" if entry["gap"] == "source" else "GAP"
    return {"None": "FOUND", "floor": "FLOOR", "where it is": "HERE"}.get(str(entry.get("on")), "THERE")


def span_of(entry: Entry, settings: bpy.types.PropertyGroup) -> list[int]:
    """The first and the last frame of the clip for which an entry is, counted from 0."""
    if "seconds" in entry and settings.frame_time:
        return [round(each / settings.frame_time) for each in entry["seconds"]]
    return [int(each) for each in entry.get("frames", (0, max(settings.frames - 1, 0)))]


def clip_frame(settings: bpy.types.PropertyGroup, frame: float) -> int:
    """The frame of the clip that is shown in a frame of the scene."""
    number = round((frame - settings.start) / (settings.step or 1.0))
    return min(max(number, 0), max(settings.frames - 1, 0))


def _change(row: bpy.types.PropertyGroup, **values: Any) -> None:
    """Change fields of the entry of a row; None takes one out, and so does the usual firmness."""
    said = (json.loads(row.entry) | values).items()
    row.entry = json.dumps({key: value for key, value in said if value is not None and (key, value) != ("firmness", 1)})


def _number(key: str, usual: float) -> dict[str, Any]:
    """How a number of the entry of a row is read and changed."""

    def get(row: bpy.types.PropertyGroup) -> float:
        value = json.loads(row.entry).get(key, usual)
        return usual if isinstance(value, str) else float(value)

    return {"get": get, "set": lambda row, value: _change(row, **{key: round(value, 4)})}


def _end(which: int) -> dict[str, Any]:
    """How the first or the last frame of a row is read and changed, in frames of the scene."""

    def get(row: bpy.types.PropertyGroup) -> int:
        settings = row.id_data.distretarget
        return round(settings.start + span_of(json.loads(row.entry), settings)[which] * settings.step)

    def set_(row: bpy.types.PropertyGroup, frame: int) -> None:
        with listed(row.id_data):
            _move(row, which, frame)

    return {"get": get, "set": set_}


def _move(row: bpy.types.PropertyGroup, which: int, frame: int) -> None:
    """Move the first or the last frame of a row, and the other with it where they would change places."""
    settings = row.id_data.distretarget
    span = span_of(json.loads(row.entry), settings)
    span[which] = clip_frame(settings, frame)
    span[1 - which] = (max, min)[which](span)
    _change(row, frames=span, seconds=None)


def _get_state(row: bpy.types.PropertyGroup) -> int:
    entry = json.loads(row.entry)
    return [state for state, *_ in STATES[subject_of(entry)]].index(state_of(entry))


def _set_state(row: bpy.types.PropertyGroup, number: int) -> None:
    entry = json.loads(row.entry)
    state, found = STATES[subject_of(entry)][number][0], re.match(r"[\d.]+", entry.get("found", ""))
    if state in CHANGES and state != state_of(entry):
        gap = {"gap": float(found[0])} if found and state == "GAP" else {}
        with listed(row.id_data):
            _change(row, **dict.fromkeys(SAID) | CHANGES[state] | gap)


class DISTRETARGET_PG_mark(bpy.types.PropertyGroup):
    """A marker, by its name, with the end of a contact at which it was put, and the frame."""

    row: IntProperty()
    end: IntProperty()
    frame: IntProperty()


class DISTRETARGET_PG_contact(bpy.types.PropertyGroup):
    clip: StringProperty()
    entry: StringProperty()
    state: EnumProperty(
        name="Contact",
        items=lambda row, _: STATES[subject_of(json.loads(row.entry))],
        get=_get_state,
        set=_set_state,
    )
    gap: FloatProperty(name="Gap", description="Between the skins [cm]", min=0.0, **_number("gap", 0.0))
    firmness: FloatProperty(
        name="Firmness", description="How far they are brought there", min=0.0, max=1.0, **_number("firmness", 1.0)
    )
    first: IntProperty(name="First frame", **_end(0))
    last: IntProperty(name="Last frame", **_end(1))


def entries_of(scene: bpy.types.Scene, clip: str) -> list[Entry]:
    """The entries for a clip."""
    return [json.loads(row.entry) for row in scene.distretarget.contacts if row.clip == clip]


def put(scene: bpy.types.Scene, clip: str, *entries: Iterable[Entry]) -> None:
    """List some entries for a clip, in place of all that are listed for it; the first of several for the same span."""
    settings, kept = scene.distretarget, {}
    for entry in itertools.chain(*entries):
        about = [subject_of(entry), sorted(title_of(entry).split(" - ")), entry.get("frames"), entry.get("seconds")]
        kept.setdefault(json.dumps(about), entry)
    rows = settings.contacts
    for number in reversed([number for number, row in enumerate(rows) if row.clip == clip]):
        rows.remove(number)
    for entry in sorted(kept.values(), key=lambda each: span_of(each, settings)):
        row = rows.add()
        row.clip, row.entry = clip, json.dumps(entry)


@contextmanager
def listed(scene: bpy.types.Scene) -> Iterator[bpy.types.PropertyGroup]:
    """The settings of a scene, while its contacts are changed: markers that were moved count, and follow after."""
    take_markers(scene)
    try:
        yield scene.distretarget
    finally:
        set_markers(scene)


def take_markers(scene: bpy.types.Scene) -> None:
    """Give contacts the frames to which their markers were moved."""
    settings = scene.distretarget
    for mark in settings.marks:
        marker = scene.timeline_markers.get(mark.name)
        if marker is not None and marker.frame != mark.frame and mark.row < len(settings.contacts):
            _move(settings.contacts[mark.row], mark.end, marker.frame)


def set_markers(scene: bpy.types.Scene) -> None:
    """Show the contacts of the clip as markers at their first and last frames; not what rests as found."""
    settings, markers = scene.distretarget, scene.timeline_markers
    for marker in filter(None, map(markers.get, settings.marks.keys())):
        markers.remove(marker)
    settings.marks.clear()
    for number, row in enumerate(settings.contacts if settings.markers and settings.step else ()):
        entry = json.loads(row.entry)
        if row.clip == settings.clip_key and (subject_of(entry) != "plant" or state_of(entry) != "FOUND"):
            start = f"{number + 1}{' dropped' if state_of(entry) == 'DROP' else ''}"
            for end, frame in enumerate((row.first, row.last)):
                mark, title = settings.marks.add(), f"{start}{' end' * end}. {title_of(entry)}"
                mark.row, mark.end, mark.frame = number, end, frame
                mark.name = markers.new(title, frame=frame).name  # Blender shortens long names
