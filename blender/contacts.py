# SPDX-License-Identifier: GPL-3.0-or-later
"""The contacts of clips, and the changes to them: entries of contact files, stored in the scene and shown as markers.

An entry is stored as its JSON text in a contact file; the properties of the panel read and change that text.
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
KINDS = ("between", "plant", "look", "distance")  # of entries: the field that names the parts of the body
CHANGED = ("keep", "gap", "firmness", "on")  # the fields that depend on the state
STATES = {  # by kind, the states of an entry: identifier, label, tooltip, and the fields that make it, {} for no choice
    "between": [
        ("FOUND", "As found", "Keep the contact where it is found in the clip", {"keep": True}),
        ("DROP", "Drop", "These parts need not touch", {"keep": False}),
        ("SOURCE", "Hold as in the clip", "Keep the distance between the skins in the clip", {"gap": "source"}),
        ("GAP", "Hold at a gap", "Keep the gap between the skins", {"gap": 0.0}),
    ],
    "plant": [
        ("FOUND", "As found", "Keep the part in place where it is found to rest in the clip", {"keep": True}),
        ("DROP", "Let go", "The part need not rest", {"keep": False}),
        ("FLOOR", "On the floor", "The part rests on the floor", {"on": "floor"}),
        ("HERE", "Where it is", "The part stays at its mean position", {"on": "where it is"}),
        ("THERE", "As in the file", "The part rests on what a contact file names", {}),
    ],
    "look": [("HOLD", "Hold", "Keep the direction that a contact file gives", {})],
    "distance": [("HOLD", "Hold", "Keep the distance that a contact file gives", {})],
}


def kind_of(entry: Entry) -> str:
    return next(each for each in KINDS if each in entry)


def title_of(entry: Entry) -> str:
    """The parts of an entry, as a title."""
    parts = entry[kind_of(entry)]
    return parts if isinstance(parts, str) else " - ".join(parts)


def state_of(entry: Entry) -> str:
    """The state of an entry, one of `STATES`; with "FOUND" it changes nothing."""
    if kind_of(entry) in ("look", "distance"):
        return "HOLD"
    if entry.get("keep") is False:
        return "DROP"
    if "gap" in entry:
        return "SOURCE" if entry["gap"] == "source" else "GAP"
    return {"None": "FOUND", "floor": "FLOOR", "where it is": "HERE"}.get(str(entry.get("on")), "THERE")


def span_of(entry: Entry, settings: bpy.types.PropertyGroup) -> list[int]:
    """The first and the last frame of an entry, frames of the clip from 0."""
    if "seconds" in entry and settings.frame_time:
        return [round(each / settings.frame_time) for each in entry["seconds"]]
    return [int(each) for each in entry.get("frames", (0, max(settings.frames - 1, 0)))]


def clip_frame(settings: bpy.types.PropertyGroup, frame: float) -> int:
    """The frame of the clip that is shown in a frame of the scene."""
    number = round((frame - settings.start) / (settings.step or 1.0))
    return min(max(number, 0), max(settings.frames - 1, 0))


def _change(row: bpy.types.PropertyGroup, **values: Any) -> None:
    """Change fields of the entry of a row; None, and the default firmness of 1, remove a field."""
    fields = {key: value for key, value in (json.loads(row.entry) | values).items() if value is not None}
    row.entry = json.dumps({key: value for key, value in fields.items() if (key, value) != ("firmness", 1)})


def _number(key: str, default: float) -> dict[str, Any]:
    """The getter and setter of a property for a number in the entry of a row."""

    def get(row: bpy.types.PropertyGroup) -> float:
        value = json.loads(row.entry).get(key, default)
        return default if isinstance(value, str) else float(value)

    return {"get": get, "set": lambda row, value: _change(row, **{key: round(value, 4)})}


def _end(which: int) -> dict[str, Any]:
    """The getter and setter of a property for the first (0) or last (1) frame of a row, in frames of the scene."""

    def get(row: bpy.types.PropertyGroup) -> int:
        settings = row.id_data.distretarget
        return round(settings.start + span_of(json.loads(row.entry), settings)[which] * settings.step)

    def set_(row: bpy.types.PropertyGroup, frame: int) -> None:
        with changing_contacts(row.id_data):
            _move(row, which, frame)

    return {"get": get, "set": set_}


def _move(row: bpy.types.PropertyGroup, which: int, frame: int) -> None:
    """Move the first or the last frame of a row; the other moves along if they would change their order."""
    settings = row.id_data.distretarget
    span = span_of(json.loads(row.entry), settings)
    span[which] = clip_frame(settings, frame)
    span[1 - which] = (max, min)[which](span)
    _change(row, frames=span, seconds=None)


def _get_state(row: bpy.types.PropertyGroup) -> int:
    entry = json.loads(row.entry)
    return [state for state, *_ in STATES[kind_of(entry)]].index(state_of(entry))


def _set_state(row: bpy.types.PropertyGroup, number: int) -> None:
    entry = json.loads(row.entry)
    (state, *_, fields), found = STATES[kind_of(entry)][number], re.match(r"[\d.]+", entry.get("found", ""))
    if fields and state != state_of(entry):
        gap = {"gap": float(found[0])} if found and state == "GAP" else {}
        with changing_contacts(row.id_data):
            _change(row, **dict.fromkeys(CHANGED) | fields | gap)


class DISTRETARGET_PG_contact(bpy.types.PropertyGroup):
    clip: StringProperty()
    entry: StringProperty()
    state: EnumProperty(
        name="Contact",
        items=lambda row, _: [state[:3] for state in STATES[kind_of(json.loads(row.entry))]],
        get=_get_state,
        set=_set_state,
    )
    gap: FloatProperty(name="Gap", description="Between the skins [cm]", min=0.0, **_number("gap", 0.0))
    firmness: FloatProperty(
        name="Firmness", description="1 reaches the gap, 0 not at all", min=0.0, max=1.0, **_number("firmness", 1.0)
    )
    first: IntProperty(name="First frame", **_end(0))
    last: IntProperty(name="Last frame", **_end(1))


def entries_of(scene: bpy.types.Scene, clip: str) -> list[Entry]:
    """The entries for a clip."""
    return [json.loads(row.entry) for row in scene.distretarget.contacts if row.clip == clip]


def put(scene: bpy.types.Scene, clip: str, *entries: Iterable[Entry]) -> None:
    """Replace the entries of a clip; of several with the same parts and frames the first is kept."""
    settings, unique = scene.distretarget, {}
    for entry in itertools.chain(*entries):
        key = [kind_of(entry), sorted(title_of(entry).split(" - ")), entry.get("frames"), entry.get("seconds")]
        unique.setdefault(json.dumps(key), entry)
    rows = settings.contacts
    for number in reversed([number for number, row in enumerate(rows) if row.clip == clip]):
        rows.remove(number)
    for entry in sorted(unique.values(), key=lambda each: span_of(each, settings)):
        row = rows.add()
        row.clip, row.entry = clip, json.dumps(entry)


@contextmanager
def changing_contacts(scene: bpy.types.Scene) -> Iterator[bpy.types.PropertyGroup]:
    """The settings of a scene, to change its contacts: before, moved markers are read, after, markers are set again."""
    take_markers(scene)
    try:
        yield scene.distretarget
    finally:
        set_markers(scene)


def take_markers(scene: bpy.types.Scene) -> None:
    """Move the ends of contacts to the frames to which their markers were moved."""
    settings = scene.distretarget
    for name, (row, end, frame) in json.loads(settings.marks).items():
        marker = scene.timeline_markers.get(name)
        if marker is not None and marker.frame != frame and row < len(settings.contacts):
            _move(settings.contacts[row], end, marker.frame)


def set_markers(scene: bpy.types.Scene) -> None:
    """Show the contacts of the clip as markers at their first and last frames, except parts that rest as found."""
    settings, markers, marks = scene.distretarget, scene.timeline_markers, {}
    for marker in filter(None, map(markers.get, json.loads(settings.marks))):
        markers.remove(marker)
    for number, row in enumerate(settings.contacts if settings.markers and settings.step else ()):
        entry = json.loads(row.entry)
        if row.clip == settings.clip_key and (kind_of(entry) != "plant" or state_of(entry) != "FOUND"):
            start = f"{number + 1}{' dropped' if state_of(entry) == 'DROP' else ''}"
            for end, frame in enumerate((row.first, row.last)):
                marker = markers.new(f"{start}{' end' * end}. {title_of(entry)}", frame=frame)
                marks[marker.name] = (number, end, frame)  # Blender shortens long names
    settings.marks = json.dumps(marks)
