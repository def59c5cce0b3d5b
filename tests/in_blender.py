"""Tests of the extension that run in Blender, through the operators that its panel calls: in_blender.py TEST FOLDER.

They need the packages bpy and distretarget. `test_blender_extension.py` runs them all.
"""

import itertools
import json
import math
import os
import subprocess
import sys
import traceback
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import bpy
import numpy as np
from mathutils import Matrix
from odd_characters import edit_bones, made

import blender
from blender import job, panel, rig
from blender.keys import curves_of
from distretarget import contacts_to_json, find_contacts, load_contacts, load_target, read_bvh, retarget, write_bvh
from distretarget.errors import SettingsError

FOLDER, ROOT = Path(sys.argv[2]), Path(__file__).resolve().parents[1]
HERO, CLAP = str(ROOT / "sample_characters" / "hero.glb"), ROOT / "sample_bvh" / "clap.bvh"
NEAR = 1e-4  # [m], and of the entries of rotation matrices
CRASH = -11  # the module of Blender 4.2.0 crashes as Python ends, after all is done
ODDITIES = "scale_001 constraints ik drivers two_roots meshes_on_bones more_bones two_characters"
operators, answers = bpy.ops.distretarget, []


def settings():
    return bpy.context.scene.distretarget


def hero(clip=CLAP, fps=60):
    """The hero in an empty scene, with a clip."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = fps
    settings().clip = str(clip)
    return imported()


def imported():
    bpy.ops.import_scene.gltf(filepath=HERO)
    armature = next(each for each in bpy.context.selected_objects if each.type == "ARMATURE")
    bpy.context.view_layer.objects.active = armature
    return armature


def odd(name):
    """An odd character, with a few frames of a clip."""
    armature, clip = made(name), FOLDER / "short.bvh"
    write_bvh(clip, read_bvh(CLAP)[100:200:16], overwrite=True)
    settings().clip = str(clip)
    return armature


def done(operator, **values):
    assert operator(**values) == {"FINISHED"}


def fault(do, *arguments, **values):
    """What an operator, or another call, says that is wrong, in one line."""
    told = "Traceback, or nothing at all"
    try:
        do(*arguments, **values)
    except (RuntimeError, SettingsError) as error:
        told = str(error)
    assert "Traceback" not in told
    return told


def warnings():
    return [line.name for line in settings().warnings]


def run(armature):
    """Retarget: bones have to be where they should."""
    done(operators.retarget)
    assert max(off(armature)) < NEAR, off(armature)
    return [line for line in warnings() if line.startswith("muted, since")]


def shown(thing, frame=None):
    """An object as Blender evaluates it, in a frame of the result if one is given."""
    if frame is not None:
        render, time = bpy.context.scene.render, answers[-1]["frame_time"] * frame
        time = settings().start + time * render.fps / render.fps_base
        bpy.context.scene.frame_set(int(time // 1), subframe=time % 1)
    return thing.evaluated_get(bpy.context.evaluated_depsgraph_get())


def off(armature, names=None):
    """How far bones are from the result, at most: their places [m], and their axes."""
    answer, bones, worst = answers[-1], armature.data.bones, np.zeros(2)
    frames, names = answer["matrices"], {*bones.keys()} & {*(names or answer["names"])} & {*answer["names"]}
    for frame in range(0, len(frames), max(1, len(frames) // 20)):
        there = shown(armature, frame)
        for name in names:
            axes = (there.matrix_world @ bones[name].matrix_local).to_3x3().to_4x4()
            is_, shall = there.matrix_world @ there.pose.bones[name].matrix, Matrix(joint(name, frame).tolist()) @ axes
            turn = np.array(is_.to_3x3().normalized()) - np.array(shall.to_3x3().normalized())
            worst = np.maximum(worst, [(is_.translation - shall.translation).length, np.abs(turn).max()])
    return worst


def joint(name, frames):
    """The matrices of a joint in some frames of the result."""
    return answers[-1]["matrices"][frames, answers[-1]["names"].index(name)]


def between(one, other, frames):
    """How far apart two joints are on average [m]."""
    return np.linalg.norm((joint(one, frames) - joint(other, frames))[:, :3, 3], axis=1).mean()


def test_bones_and_skin_are_where_the_result_has_them_and_nothing_is_lost():
    armature = hero("")
    armature.animation_data_create().action = bpy.data.actions.new("before")
    settings().start = 11
    done(operators.retarget, filepath=str(CLAP))
    assert max(off(armature)) < NEAR
    frames = answers[-1]["matrices"]
    assert np.allclose(armature.animation_data.action.frame_range, [11, 10 + len(frames)], atol=0.01)
    assert {"before", "clap"} <= {*bpy.data.actions.keys()}
    (skeleton, skin), (mesh,) = rig.shape_of(armature), rig.skinned_meshes(armature)
    arms = np.insert(skin.vertices[:, None] - skeleton.rest_positions[skin.joints], 3, 1.0, axis=2)
    for frame in range(0, len(frames), 10):
        shall = np.einsum("vb,vbij,vbj->vi", skin.weights, frames[frame][skin.joints, :3], arms)
        there = shown(mesh, frame)
        assert np.abs([there.matrix_world @ vertex.co for vertex in there.data.vertices] - shall).max() < NEAR


def test_results_are_those_of_the_command_line():
    for file in (HERO, str(FOLDER / "blocks.glb")):
        if file == HERO:
            hero()
        else:
            odd("blocks")
            bpy.ops.export_scene.gltf(filepath=file, export_animations=False, export_rest_position_armature=True)
        done(operators.retarget)
        motion = retarget(read_bvh(settings().clip), load_target(file)).motion
        names = [name for name in motion.skeleton.names if name in answers[-1]["names"]]
        places = motion.positions[:, [motion.skeleton.names.index(name) for name in names]] * [1, 1, -1]
        found = np.stack([joint(name, slice(None))[:, [0, 2, 1], 3] for name in names], axis=1)
        assert np.abs(found - places).max() < 1e-3  # the rest pose is in single precision


def test_an_armature_of_the_scene_that_moves_is_a_clip():
    """A clip is on one hero, large and turned, whose hips slide below a root, and goes from there to another."""
    one = hero(fps=30)
    with edit_bones(one) as bones:
        top = bones.new("Top")
        top.tail, bones["Hips"].parent = (0, 0, 20), top
    one.rotation_mode = "XYZ"
    one.location, one.rotation_euler, one.scale = (1, 2, 0), (0, 0, 0.5), (2, 2, 2)
    settings().start = 5
    done(operators.retarget)
    settings().performer = one
    assert "is the character; choose another armature" in fault(operators.retarget)
    for frame, way in ((5, 0), (40, 100)):
        one.pose.bones["Hips"].location = (way, 0, 0)
        one.pose.bones["Hips"].keyframe_insert("location", frame=frame)
    bpy.context.scene.frame_set(7)
    other = imported()
    done(operators.retarget)
    assert bpy.context.scene.frame_current == 7
    actions = [each.animation_data.action for each in (one, other)]
    assert np.allclose(*(each.frame_range for each in actions), atol=1.0)
    assert actions[1].name.startswith("clap")
    assert any(row.clip == settings().clip_key for row in settings().contacts)
    hips = []
    for number in range(5, 41, 7):
        bpy.context.scene.frame_set(number)
        there = shown(one), shown(other)
        hips.append([each.matrix_world @ each.pose.bones["Hips"].head for each in there])
        for name in ("LeftForeArm", "RightHand", "LeftFoot"):
            a, b = ((each.matrix_world @ each.pose.bones[name].matrix).to_quaternion() for each in there)
            turn = math.degrees(a.rotation_difference(b).angle)
            assert min(turn, 360 - turn) < 2.0  # as both have the same skin
    ways = np.linalg.norm(np.subtract(hips[-1], hips[0]), axis=1)
    assert ways[0] > 1.0
    assert math.isclose(ways[1], ways[0] / 200, rel_tol=0.05)  # the first is 200 times as large


def test_what_is_wrong_is_told_in_a_line():
    broken = FOLDER / "broken.bvh"
    broken.write_text("HIERARCHY nonsense")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    settings().clip = str(CLAP)
    assert "select the armature of a character" in fault(operators.retarget)
    armature = hero()
    for clip, words in (("", "choose a clip"), ("/nowhere.bvh", "there is no such file"), (broken, "broken.bvh")):
        settings().clip = str(clip)
        assert words in fault(operators.retarget)
    assert "choose a folder of clips" in fault(operators.retarget_folder)
    settings().clip, armature.scale = str(CLAP), (1, 2, 1)
    bpy.context.view_layer.update()
    assert "uneven scale" in fault(operators.retarget)
    assert not {"walk", "broken", "clap"} & {*bpy.data.actions.keys()}


def test_a_folder_becomes_an_action_and_a_track_for_each_clip():
    clips = {f"clip {number:02}": read_bvh(CLAP.with_name("wave.bvh"))[number : 3 * number + 8] for number in range(6)}
    for name, motion in clips.items():
        write_bvh(FOLDER / f"{name}.bvh", motion)
    (FOLDER / "notes.txt").write_text("no clip")
    (FOLDER / "bad.bvh").write_text("nonsense")
    armature = hero(fps=30)
    settings().folder, settings().as_assets, settings().push_down = str(FOLDER), True, True
    done(operators.retarget_folder)
    assert settings().verdict.startswith("6 of 7 clips retargeted; ")
    assert "bad.bvh" in settings().verdict
    for (name, motion), track in zip(clips.items(), armature.animation_data.nla_tracks, strict=True):
        action, (strip,) = bpy.data.actions[name], track.strips
        assert action.use_fake_user
        assert action.asset_data is not None
        assert (track.name, track.mute, strip.action) == (name, name != "clip 05", action)
        for each in (action.frame_range, (strip.frame_start, strip.frame_end)):
            assert np.allclose(each, [1, 1 + (len(motion) - 1) * motion.frame_time * 30], atol=1e-3)
    assert armature.animation_data.action is None
    assert max(off(armature)) < NEAR


def test_odd_characters_take_on_a_motion():
    for name in ODDITIES.split():
        armature = odd(name)
        if name == "two_characters":
            armature = bpy.context.view_layer.objects.active = bpy.data.objects["Armature 2"]
        assert bool(run(armature)) == (name in ("constraints", "ik", "drivers")), name


def test_a_character_without_legs():
    armature = hero()
    with edit_bones(armature) as bones:
        for bone in [each for each in bones if each.name.endswith(("Leg", "Foot", "ToeBase"))]:
            bones.remove(bone)
    assert not run(armature)


def test_tracks_and_actions_of_before_do_not_disturb():
    armature = odd("names_with_spaces")
    data = armature.animation_data_create()
    data.action = bpy.data.actions.new("old")
    for bone in armature.pose.bones:
        bone.location, bone.scale, bone.rotation_mode = (1, 2, 3), (2, 2, 2), "XYZ"
        bone.keyframe_insert("location", frame=1)
        bone.keyframe_insert("scale", frame=1)
    strip, data.action = data.nla_tracks.new().strips.new("old", 1, data.action), None
    data.nla_tracks[0].select, strip.select, data.nla_tracks.active = True, True, data.nla_tracks[0]
    data.use_tweak_mode, data.action_influence, armature.data.pose_position = True, 0.5, "REST"
    assert run(armature)
    assert {bone.rotation_mode for bone in armature.pose.bones} == {"XYZ"}  # of the old action
    top = armature.parent = bpy.data.objects.new("Top", None)
    top.keyframe_insert("location", frame=1)
    armature.constraints.new("LIMIT_LOCATION")
    run(armature)
    assert [line[: line.index(" may move")] for line in warnings() if " may move" in line] == ["'Armature'", "'Top'"]


def test_times_and_scenes():
    armature = odd("names_with_spaces")
    settings().whole_frames, bpy.context.scene.render.fps = True, 30
    assert not run(armature)
    assert math.isclose(settings().step, 0.5, abs_tol=1e-3)
    assert np.allclose(armature.animation_data.action.frame_range, [1, 1 + int(settings().step * 6)])
    other = bpy.data.scenes.new("Other")
    other.collection.objects.link(armature)
    other.distretarget.clip, settings().verdict = settings().clip, ""
    with bpy.context.temp_override(scene=other):
        done(operators.retarget)
    assert other.distretarget.verdict
    assert not settings().verdict


def test_what_is_stopped_changes_nothing():
    odd("names_with_spaces")
    before = len(bpy.data.actions)

    def begun():
        steps = blender.operators.retarget.do(SimpleNamespace(filepath="", report=print), bpy.context)
        assert next(steps).startswith("Retargeting")
        return steps, steps.gi_frame.f_locals["job"]

    steps, begun_job = begun()
    begun_job.process.kill()
    assert fault(list, steps) == "retargeting stopped: -9; nothing is changed"
    steps, begun_job = begun()
    steps.close()
    assert begun_job.process.poll() is not None
    assert not begun_job.folder.exists()
    assert len(bpy.data.actions) == before
    bpy.ops.ed.undo_push(message="before")
    assert operators.retarget("EXEC_DEFAULT", True) == {"FINISHED"}
    bpy.ops.ed.undo()
    data = bpy.data.objects["Armature"].animation_data
    assert data is None or data.action is None
    assert len(bpy.data.actions) == before
    steps, _ = begun()
    bpy.data.objects.remove(bpy.data.objects["Armature"])
    assert fault(list, steps) == "'Armature' or its scene is gone; the motion was dropped"


def test_linked_characters_are_refused_and_overrides_work():
    rest = rig.shape_of(odd("posed"))[1].vertices
    clip, character = settings().clip, str(FOLDER / "character.blend")
    bpy.ops.wm.save_as_mainfile(filepath=character)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    settings().clip = clip
    with bpy.data.libraries.load(character, link=True) as (_, linked):
        linked.objects = ["Armature", "Body"]
    armature, body = linked.objects
    for each in linked.objects:
        bpy.context.scene.collection.objects.link(each)
    assert np.allclose(rig.shape_of(armature)[1].vertices, rest, atol=1e-6)
    bpy.context.view_layer.objects.active = armature
    assert "is linked from another file; make it local or an override" in fault(operators.retarget)
    own = armature.override_create(remap_local_usages=True)
    body.override_create(remap_local_usages=True)
    bpy.context.view_layer.objects.active = own
    assert not run(own)


def test_the_command_saves_another_file():
    for name in ("ik", "two_characters"):
        odd(name)
        bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / f"{name}.blend"))

    def command(character, *arguments, out="other.blend"):
        command = [sys.executable, ROOT / "blender" / "command.py", "--", FOLDER / character, FOLDER / "short.bvh"]
        told = subprocess.run([*command, FOLDER / out, *arguments], capture_output=True, text=True, timeout=100)
        assert "Traceback" not in told.stderr, told.stderr
        return told

    before = (FOLDER / "ik.blend").read_bytes()
    told = command("ik.blend", "--keys", "IK", "--start", "5", out="out.blend")
    assert told.returncode in (0, CRASH)
    assert "feet do not skate" in told.stdout
    assert (FOLDER / "ik.blend").read_bytes() == before
    two = "two_characters.blend"
    for arguments, words, out in (
        ([two], "expected the name of a new .blend file", "out.blend"),
        ([two], "choose with --armature, found 'Armature', 'Armature 2'", "other.blend"),
        ([two, "--armature", "Nobody"], "one armature 'Nobody', found 'Armature', 'Armature 2'", "other.blend"),
        ([two, "--armature", "Armature", "--contacts", "none.json"], "no such file", "other.blend"),
        (["none.blend"], "expected a .blend file", "other.blend"),
    ):
        told = command(*arguments, out=out)
        assert told.returncode in (1, CRASH)
        assert words in told.stderr, told.stderr
    assert not (FOLDER / "other.blend").exists()
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "out.blend"))
    action = bpy.data.objects["Armature"].animation_data.action
    assert (action.name, action.frame_range[0]) == ("short", 5)


def test_contacts_are_dropped_made_moved_kept_and_exchanged():
    armature = hero()
    scene, file = bpy.context.scene, str(FOLDER / "own.contacts.json")

    def listed():
        return [json.loads(row.entry) for row in settings().contacts if row.clip == settings().clip_key]

    assert "retarget the clip once" in fault(operators.contact_make)
    done(operators.retarget)
    motion, target = read_bvh(CLAP), load_target(HERO)
    assert listed() == json.loads(contacts_to_json(find_contacts(motion, target)))["contacts"]
    row = next(row for row in settings().contacts if "between" in row.entry)
    claps = [entry["frames"] for entry in listed() if "between" in entry]
    assert [each.frame for each in scene.timeline_markers] == [frame + 1 for span in claps for frame in span]
    span = slice(*claps[0])
    before = between("LeftHand", "RightHand", span)
    row.state = "DROP"
    assert json.loads(row.entry)["keep"] is False
    assert "dropped" in scene.timeline_markers[0].name
    done(operators.retarget)
    assert between("LeftHand", "RightHand", span) > 1.05 * before
    assert np.abs(np.subtract(*(each["matrices"][130:, :, :3, 3] for each in answers[-2:]))).max() < NEAR

    scene.timeline_markers[0].frame += 5
    bpy.ops.object.mode_set(mode="POSE")
    for bone in armature.pose.bones:
        (bone if bpy.app.version >= (5, 0) else bone.bone).select = bone.name in ("LeftHand", "Head")
    scene.use_preview_range, scene.frame_preview_start, scene.frame_preview_end = True, 231, 241
    done(operators.contact_make)
    assert next(entry for entry in listed() if entry.get("keep") is False)["frames"] == [claps[0][0] + 5, claps[0][1]]
    new = {"between": ["Head", "LeftHand"], "gap": 0.0, "frames": [230, 240]}
    row = settings().contacts[settings().contact]
    assert json.loads(row.entry) == new
    row.gap, row.firmness = 2.5, 0.75
    assert json.loads(row.entry) == new | {"gap": 2.5, "firmness": 0.75}
    row.firmness = 1.0
    far = between("LeftHand", "Head", slice(230, 240))
    done(operators.retarget)
    assert between("LeftHand", "Head", slice(230, 240)) < 0.5 * far
    done(operators.contacts_export, filepath=file)
    assert len(retarget(motion, target, contacts=load_contacts(file)).motion) == len(motion)

    own = listed()
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "own.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "own.blend"))
    assert listed() == own
    settings().contacts.clear()
    done(operators.contacts_import, filepath=file)
    assert sorted(map(json.dumps, listed())) == sorted(map(json.dumps, own))
    assert "JSON" in fault(operators.contacts_import, filepath=__file__)
    assert "no such file" in fault(operators.contacts_import, filepath=str(FOLDER / "none.json"))
    settings().contact = 0
    done(operators.contact_remove)
    assert listed() == own[1:]
    settings().clip = "other.bvh"
    assert not listed()
    assert not bpy.context.scene.timeline_markers


def test_pairs_are_chosen_and_kept_with_the_character():
    armature, file = hero(), str(FOLDER / "own.blend")
    name = armature.name
    done(operators.retarget)
    assert {"Hips", "LeftElbow"} <= {*settings().joints.keys()}
    assert armature.distretarget_pairs["LeftForeArm"].source == "LeftElbow"
    choice = {"LeftForeArm": "", "Head": "Neck", "Neck": "Nowhere"}
    for bone, source in choice.items():
        armature.distretarget_pairs[bone].source = source
    done(operators.retarget)
    differ = np.abs(np.subtract(*(each["matrices"][..., :3, :3] for each in answers[-2:]))).max(axis=(0, 2, 3))
    changed = {bone for bone, each in zip(answers[-1]["names"], differ, strict=True) if each > 0.1}
    assert "LeftForeArm" in changed
    assert "LeftLeg" not in changed
    assert any("no joint 'Nowhere', which was chosen for 'Neck'" in line for line in warnings())
    bpy.ops.wm.save_as_mainfile(filepath=file)
    bpy.ops.wm.open_mainfile(filepath=file)
    armature = bpy.context.view_layer.objects.active = bpy.data.objects[name]
    pairs = armature.distretarget_pairs
    assert {each.name: each.source for each in pairs if each.is_chosen} == choice
    pairs["LeftForeArm"].is_chosen = False
    done(operators.retarget)
    assert pairs["LeftForeArm"].source == "LeftElbow"
    assert {each.name for each in pairs if each.is_chosen} == {"Head", "Neck"}


def test_the_panel_draws_what_there_is():
    hero()
    context = MagicMock(scene=bpy.context.scene, active_object=bpy.context.active_object)
    context.region.width, context.preferences.system.ui_scale = 300, 1.0
    for _ in range(2):  # before and after
        drawn = SimpleNamespace(layout=MagicMock())
        for each in panel.CLASSES:
            if issubclass(each, bpy.types.Panel):
                each.draw(drawn, context)
        for call in drawn.layout.prop.call_args_list:
            assert call.args[1] in call.args[0].bl_rna.properties
        done(operators.retarget)
    assert [call.args[3] for call in drawn.layout.template_list.call_args_list] == ["contacts", "distretarget_pairs"]


def test_controls_bring_joints_to_where_the_motion_has_them():
    for name, mode in itertools.product(("copies", "rigify"), ("FK", "IK")):
        armature = odd(name)
        bones = armature.pose.bones
        armature.location, armature.rotation_euler, armature.scale = (1, 2, 0), (0.5, 0, 1), (2, 2, 2)
        armature.keyframe_insert("location", frame=1)
        bpy.context.scene.frame_set(40)
        deforming = {bone.name for bone in armature.data.bones if bone.use_deform}
        muted = [each.mute for bone in bones for each in bone.constraints]
        for keys in ("JOINTS", mode):
            settings().keys = keys
            done(operators.retarget)
        assert [each.mute for bone in bones for each in bone.constraints] == muted
        answer, action = answers[-1], armature.animation_data.action
        assert len({*answer["names"]} & deforming) >= 20
        mm = 1700 / np.ptp(answer["matrices"][0, :, :3, 3], axis=0).max()  # on a body of 1.7 m
        assert off(armature, deforming)[0] * mm < 1.0, warnings()
        curves = curves_of(action)
        paths = {each.data_path.rpartition("]")[0] + "]" for each in curves}
        assert not [name for name in deforming if bones[name].path_from_id() in paths]
        assert len(answer["switches"]) == 4
        for bone, name, value in answer["switches"]:
            assert bones[bone][name] == value
            for curve in [each for each in curves if each.data_path == f'pose.bones["{bone}"]["{name}"]']:
                curves.remove(curve)
            bones[bone][name] = type(value)(1 - value)
        armature.update_tag()
        bpy.context.view_layer.update()
        assert off(armature, deforming)[0] * mm < 1.0, "after the switches are turned"


def test_nothing_is_left_after_it_is_disabled():
    blender.unregister()
    assert not [name for name in dir(bpy.types) if "DISTRETARGET" in name]
    assert not hasattr(bpy.context.scene, "distretarget")


if __name__ == "__main__":
    apply = job.Job.apply
    job.Job.apply = lambda each: answers.append(each.answer) or apply(each)
    blender.register()
    try:
        globals()[sys.argv[1]]()
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(1)
    os._exit(0)  # Blender may hang as it ends
