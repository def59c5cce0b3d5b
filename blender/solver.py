# SPDX-License-Identifier: GPL-3.0-or-later
"""Find the poses of a rig's controls in a Blender of its own: solver.py FOLDER.

FOLDER has `job.json` with the name of the "armature" and "keys", "FK" or "IK", the armature in `character.blend`, and
the joints' motion in `result.npz`. It gets `controls.npz`, with `names`, (controls,), and `bases`,
(controls, frames, 4, 4), and `controls.json` with "switches", each a bone, a property and its value, and "lines" on
what cannot follow.
"""

import importlib
import json
import sys
from pathlib import Path

import bpy
import numpy as np


def main(folder: Path) -> None:
    """Do the job in a folder."""
    here = Path(__file__).parent
    sys.path.insert(0, str(here.parent))
    controls, keys = (importlib.import_module(f"{here.name}.{name}") for name in ("controls", "keys"))
    job = json.loads((folder / "job.json").read_text("utf-8"))
    with bpy.data.libraries.load(str(folder / "character.blend")) as (_, wanted):
        wanted.objects = [job["armature"]]
    (armature,) = wanted.objects
    armature.hide_viewport = False
    bpy.context.scene.collection.objects.link(armature)
    with (folder / "progress").open("ab", buffering=0) as progress:
        result, tell = keys.Result.load(folder), lambda percent: progress.write(b"." * percent)
        solved = controls.solve(armature, result, job["keys"], tell)
    np.savez(folder / "controls.npz", names=[*solved.bases], bases=np.array([*solved.bases.values()]))
    switches = [[each.bone, each.name, each.values[job["keys"]]] for each in solved.switches]
    told = {"switches": switches, "lines": controls.lines_on(solved)}
    (folder / "controls.json").write_text(json.dumps(told), "utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[-1]))
