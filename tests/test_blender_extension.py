"""The extension for Blender, through the operators that its panel calls.

It needs the package bpy, here or in the Python that DISTRETARGET_BLENDER names, and distretarget in that Python.
"""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from bodies import SAMPLES

ROOT = Path(__file__).resolve().parents[1]
HERO = ROOT / "sample_characters" / "hero.glb"
BLENDER = os.environ.get("DISTRETARGET_BLENDER") or (sys.executable if importlib.util.find_spec("bpy") else None)

pytestmark = pytest.mark.skipif(BLENDER is None, reason="Blender's module bpy is not installed")

BEGIN = """
import importlib.util, json, os, sys
import bpy
import numpy as np

spec = importlib.util.spec_from_file_location("extension", sys.argv[1], submodule_search_locations=[sys.argv[2]])
extension = importlib.util.module_from_spec(spec)
sys.modules["extension"] = extension
spec.loader.exec_module(extension)
bpy.ops.wm.read_factory_settings(use_empty=True)
extension.register()
scene = bpy.context.scene
settings = scene.distretarget

def character(path):
    bpy.ops.import_scene.gltf(filepath=path)
    armature = next(each for each in bpy.data.objects if each.type == "ARMATURE")
    bpy.context.view_layer.objects.active = armature
    return armature

def said(operator):
    try:
        return sorted(operator())
    except RuntimeError as error:
        return str(error).strip()

def end(told):
    print("told:" + json.dumps(told))
    sys.stdout.flush()
    os._exit(0)
"""

ONE = """
armature = character(sys.argv[3])
before = armature.animation_data_create()
before.action = bpy.data.actions.new("before")
from extension import operators
results, made = [], operators.new_action
def kept(armature, result, *more):
    results.append(result)
    return made(armature, result, *more)
operators.new_action = kept
settings.clip, settings.start, scene.render.fps = sys.argv[4], 11, 60
status = said(bpy.ops.distretarget.retarget)
(result,) = results
worst = 0.0
for frame in range(0, len(result.places), 10):
    time = 11 + frame * result.frame_time * 60
    scene.frame_set(int(time), subframe=time - int(time))
    shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
    for joint, name in enumerate(result.names):
        if name in shown.pose.bones:
            head = np.array(shown.matrix_world @ shown.pose.bones[name].head)
            worst = max(worst, float(np.linalg.norm(head - result.places[frame, joint])))
end({"status": status, "worst": worst, "actions": sorted(each.name for each in bpy.data.actions),
     "range": list(armature.animation_data.action.frame_range), "verdict": settings.verdict,
     "frames": len(result.places)})
"""

WRONG = """
told = {}
settings.clip = sys.argv[4]
told["no character"] = said(bpy.ops.distretarget.retarget)
armature = character(sys.argv[3])
for name, clip in (("no clip", ""), ("no file", "/nowhere.bvh"), ("kind", sys.argv[1]), ("broken", sys.argv[5])):
    settings.clip = clip
    told[name] = said(bpy.ops.distretarget.retarget)
armature.scale = (1, 2, 1)
bpy.context.view_layer.update()
settings.clip = sys.argv[4]
told["scale"] = said(bpy.ops.distretarget.retarget)
end({"told": told, "actions": [each.name for each in bpy.data.actions if each.name in ("walk", "broken", "clap")]})
"""

FOLDER = """
armature = character(sys.argv[3])
settings.folder, settings.as_assets = sys.argv[4], True
status = said(bpy.ops.distretarget.retarget_folder)
found = {each.name: [each.use_fake_user, each.asset_data is not None] for each in bpy.data.actions}
extension.unregister()
end({"status": status, "actions": found, "verdict": settings.verdict if hasattr(scene, "distretarget") else ""})
"""


def told(script, *arguments):
    """What a script says that runs in Blender."""
    own = [str(ROOT / "blender" / "__init__.py"), str(ROOT / "blender")]
    command = [BLENDER, "-c", BEGIN + script, *own, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    lines = [line for line in done.stdout.splitlines() if line.startswith("told:")]
    assert lines, done.stdout[-2000:] + done.stderr[-2000:]
    return json.loads(lines[-1].removeprefix("told:"))


def test_bones_are_where_the_result_has_them_and_nothing_is_lost():
    found = told(ONE, HERO, SAMPLES / "clap.bvh")
    assert found["status"] == ["FINISHED"]
    assert found["worst"] < 1e-4
    assert {"before", "clap"} <= set(found["actions"])
    assert found["range"] == pytest.approx([11, 11 + found["frames"] - 1], abs=0.01)
    assert "Skin touches as in the source" in found["verdict"]


def test_what_is_wrong_is_told_in_a_line(tmp_path):
    broken = tmp_path / "broken.bvh"
    broken.write_text("HIERARCHY nonsense")
    found = told(WRONG, HERO, SAMPLES / "walk.bvh", broken)
    words = {
        "no character": "select the armature of a character",
        "no clip": "choose a clip",
        "no file": "there is no such file",
        "kind": "expected a clip",
        "broken": "broken.bvh",
        "scale": "uneven scale",
    }
    for name, expected in words.items():
        assert expected in found["told"][name], found["told"]
        assert "Traceback" not in found["told"][name]
    assert not found["actions"]


def test_a_folder_becomes_an_action_for_each_clip(tmp_path):
    for name in ("wave", "squat"):
        (tmp_path / f"{name}.bvh").write_bytes((SAMPLES / f"{name}.bvh").read_bytes())
    (tmp_path / "notes.txt").write_text("no clip")
    (tmp_path / "bad.bvh").write_text("nonsense")
    found = told(FOLDER, HERO, tmp_path)
    assert found["status"] == ["FINISHED"]
    assert found["actions"]["wave"] == [True, True]
    assert found["actions"]["squat"] == [True, True]
