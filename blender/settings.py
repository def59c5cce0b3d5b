# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties: the panel's settings and results in a scene, and the pairs of bones and joints of a character."""

from pathlib import PurePath

import bpy
from bpy import props

from .contacts import DISTRETARGET_PG_contact, set_markers
from .rig import title_of


def _clip_changed(settings, _context):
    settings.step = 0.0
    set_markers(settings.id_data)


class DISTRETARGET_PG_pair(bpy.types.PropertyGroup):
    """The bone called `name`, and the joint of the clip that drives it."""

    source: props.StringProperty(name="Joint", update=lambda pair, _: setattr(pair, "is_chosen", True))
    is_chosen: props.BoolProperty(name="Keep", description="Keep this choice; else the joint is found anew")


class DISTRETARGET_PG_warning(bpy.types.PropertyGroup):
    """A warning, whose text is `name`, and its frame, or -1."""

    frame: props.IntProperty(default=-1)


class DISTRETARGET_PG_settings(bpy.types.PropertyGroup):
    clip: props.StringProperty(
        name="Clip", description="BVH, FBX, GLB, VRMA or npz", subtype="FILE_PATH", update=_clip_changed
    )
    performer: props.PointerProperty(
        name="Armature",
        description="An armature of the scene whose motion is the clip, in place of a file",
        type=bpy.types.Object,
        poll=lambda settings, each: each.type == "ARMATURE" and each.name in settings.id_data.objects,
        update=_clip_changed,
    )
    animation: props.StringProperty(name="Animation", description="One of those in the file", update=_clip_changed)
    start: props.IntProperty(name="Start", description="The frame at which the action begins", default=1)
    whole_frames: props.BoolProperty(name="Whole frames", description="Key each frame of the scene, not of the clip")
    mirror: props.BoolProperty(name="Mirror", description="Exchange left and right")
    loop: props.BoolProperty(name="Loop", description="Blend the motion near its ends so that it repeats smoothly")
    in_place: props.BoolProperty(name="In place", description="Leave out the path along the floor")
    keys: props.EnumProperty(
        name="Keys",
        description="The bones that get keys",
        items=[
            ("JOINTS", "Bones of the meshes", "Constraints, drivers and NLA tracks that move them are muted"),
            ("FK", "Controls, FK", "FK and IK controls, with switches at FK"),
            ("IK", "Controls, IK", "FK and IK controls, with switches at IK"),
        ],
    )
    markers: props.BoolProperty(
        name="Markers",
        description="Show contacts in the timeline; moved markers change the contacts at the next retargeting",
        default=True,
        update=lambda settings, _: set_markers(settings.id_data),
    )
    folder: props.StringProperty(name="Folder", description="A folder of clips", subtype="DIR_PATH")
    as_assets: props.BoolProperty(name="Mark as assets", description="Show the actions in the asset browser")
    push_down: props.BoolProperty(name="Push down", description="Make NLA tracks of the actions; only the last is on")
    # Results of the last retargeting:
    verdict: props.StringProperty()
    warnings: props.CollectionProperty(type=DISTRETARGET_PG_warning)
    frames: props.IntProperty()
    frame_time: props.FloatProperty(description="In seconds")
    step: props.FloatProperty(description="Frames of the scene per frame of the clip; 0 before retargeting")
    joints: props.CollectionProperty(type=bpy.types.PropertyGroup)  # of the clip, by name
    contacts: props.CollectionProperty(type=DISTRETARGET_PG_contact)
    marks: props.StringProperty(default="{}")  # by marker: contact, 0 for its first or 1 for its last frame, frame
    contact: props.IntProperty(description="The contact that is chosen in the list")

    @property
    def clip_key(self) -> str:
        """The name under which contacts of the clip are stored, independent of its folder."""
        return title_of(self.performer) if self.performer else clip_key(self.clip, self.animation)


def clip_key(clip: str | PurePath, animation: str) -> str:
    return "#".join(filter(None, [bpy.path.basename(str(clip)), animation]))


GROUPS = (DISTRETARGET_PG_pair, DISTRETARGET_PG_warning, DISTRETARGET_PG_contact, DISTRETARGET_PG_settings)
