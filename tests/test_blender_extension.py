"""The extension for Blender: the tests of `in_blender.py`, each in a Blender of its own.

They need the package bpy, here or in the Python that DISTRETARGET_BLENDER names, and distretarget in that Python.
"""

import importlib.util
import os
import re
import subprocess
import sys

import pytest
from bodies import ROOT

BLENDER = os.environ.get("DISTRETARGET_BLENDER") or (sys.executable if importlib.util.find_spec("bpy") else None)
TESTS = ROOT / "tests" / "in_blender.py"

pytestmark = pytest.mark.skipif(BLENDER is None, reason="Blender's module bpy is not installed")


@pytest.mark.parametrize("test", re.findall(r"^def test_(\w+)", TESTS.read_text("utf-8"), re.MULTILINE))
def test_in_blender(test, tmp_path):
    paths = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    command, environment = [BLENDER, TESTS, f"test_{test}", tmp_path], os.environ | {"PYTHONPATH": paths}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=600)
    assert not done.returncode, done.stdout[-1000:] + done.stderr[-3000:]
