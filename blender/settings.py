# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel asks for and shows: of a scene, and of a character the joints that move its bones."""

from pathlib import PurePath

import bpy

from . import contacts
from .rig import title_of


def _is_another(settings, _context):
    settings.step = 0.0
    contacts.set_markers(settings.id_data)


def _is_chosen(pair, _context):
    pair.is_chosen = True


class DISTRETARGET_PG_pair(bpy.types.PropertyGroup):
    """The joint of the clip that moves a bone, which `name` is."""

    source: bpy.props.StringProperty(name="Joint", description="The joint of the clip", update=_is_chosen)
    is_chosen: bpy.props.BoolProperty(name="Chosen", description="It was chosen here, and stays so")


class DISTRETARGET_PG_warning(bpy.types.PropertyGroup):
    text: bpy.props.StringProperty()
    frame: bpy.props.IntProperty(default=-1)


class DISTRETARGET_PG_settings(bpy.types.PropertyGroup):
    clip: bpy.props.StringProperty(
        name="Clip", subtype="FILE_PATH", description="BVH, FBX, GLB, VRMA or npz", update=_is_another
    )
    performer: bpy.props.PointerProperty(
        name="Armature",
        type=bpy.types.Object,
        poll=lambda settings, each: each.type == "ARMATURE" and each.name in settings.id_data.objects,
        description="An armature of the scene whose motion is the clip, in place of a file",
        update=_is_another,
    )
    animation: bpy.props.StringProperty(
        name="Animation", description="Which of several animations of the file", update=_is_another
    )
    start: bpy.props.IntProperty(name="Start", default=1, description="The frame at which the action begins")
    whole_frames: bpy.props.BoolProperty(
        name="Whole frames", description="A key in each frame of the scene, in place of one for each frame of the clip"
    )
    mirror: bpy.props.BoolProperty(name="Mirror", description="Exchange left and right")
    loop: bpy.props.BoolProperty(name="Loop", description="The end leads to the start")
    in_place: bpy.props.BoolProperty(name="In place", description="Leave out the path along the floor")
    keys: bpy.props.EnumProperty(
        name="Keys",
        description="Which bones get the keys",
        items=[
            ("JOINTS", "Bones of the meshes", "Whatever else moves them is muted"),
            ("FK", "Controls, FK", "FK and IK controls, with switches at FK"),
            ("IK", "Controls, IK", "FK and IK controls, with switches at IK"),
        ],
    )
    verdict: bpy.props.StringProperty()
    warnings: bpy.props.CollectionProperty(type=DISTRETARGET_PG_warning)
    # Of the clip, since it was retargeted last:
    frames: bpy.props.IntProperty()
    frame_time: bpy.props.FloatProperty(description="In seconds")
    step: bpy.props.FloatProperty(description="Frames of the scene for one of the clip; 0 until it is retargeted")
    joints: bpy.props.CollectionProperty(type=bpy.types.PropertyGroup)  # by their names
    contacts: bpy.props.CollectionProperty(type=contacts.DISTRETARGET_PG_contact)
    marks: bpy.props.CollectionProperty(type=contacts.DISTRETARGET_PG_mark)
    contact: bpy.props.IntProperty(description="The contact that is chosen in the list")
    markers: bpy.props.BoolProperty(
        name="Markers",
        default=True,
        description="Show contacts in the timeline; markers that are moved count when it is retargeted again",
        update=lambda settings, _: contacts.set_markers(settings.id_data),
    )
    folder: bpy.props.StringProperty(name="Folder", subtype="DIR_PATH", description="A folder of clips")
    as_assets: bpy.props.BoolProperty(name="Mark as assets", description="Show the actions in the asset browser")
    push_down: bpy.props.BoolProperty(
        name="Push down", description="Make an NLA track of each action; all but the last are muted"
    )

    @property
    def clip_key(self) -> str:
        """The name by which contacts of the clip are kept, also if its folder moves."""
        return title_of(self.performer) if self.performer else clip_key(self.clip, self.animation)


def clip_key(clip: str | PurePath, animation: str) -> str:
    return "#".join(filter(None, [bpy.path.basename(str(clip)), animation]))


GROUPS = (
    DISTRETARGET_PG_pair,
    DISTRETARGET_PG_warning,
    contacts.DISTRETARGET_PG_mark,
    contacts.DISTRETARGET_PG_contact,
    DISTRETARGET_PG_settings,
)
