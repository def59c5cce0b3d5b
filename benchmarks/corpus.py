"""Retarget every BVH file below a folder to its own body with longer arms and shorter legs.

    python benchmarks/corpus.py FOLDER [--only GLOB]

Prints a line per file: `ok`, number of frames, seconds including start-up, mean stress x 1000 of the rotation copy and
of the result, and the file's name; or `refused`, if the program refuses the file in one line, and that line; or
`FAILED` for anything else. The exit status is 1 if a file failed.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import click
import numpy as np
from edits import ARMS_AND_LEGS, edited

from distretarget import DistretargetError, Motion, read_bvh
from distretarget.io.target_file import skeleton_to_json

VERDICTS = ("ok", "refused", "FAILED")


def outcome(path: Path, name: str) -> tuple[str, str]:
    """Run the command line on a file; the verdict, by exit status, messages and output, and the text after it."""
    try:
        motion = read_bvh(path)
    except DistretargetError:
        motion = None
    with tempfile.TemporaryDirectory(prefix="corpus-") as scratch:
        target, output, figures = (Path(scratch, name) for name in ("target.json", "out.bvh", "out.json"))
        if motion:
            body = edited(motion.rigid_skeleton, ARMS_AND_LEGS)
            target.write_text(skeleton_to_json(body, "target"), encoding="utf-8", errors="surrogateescape")
        command = [sys.executable, "-m", "distretarget", path, target if motion else path, "-o", output]
        started = time.perf_counter()
        done = subprocess.run([*command, "--json", figures], capture_output=True, text=True, timeout=600)
        seconds = time.perf_counter() - started
        line = done.stderr.strip()
        if done.returncode != 0:  # a refusal has status 1, one line that names the file, and no output
            one_line = "\n" not in line and line.startswith(f"distretarget: {path}:")
            if done.returncode == 1 and one_line and not done.stdout and not output.exists():
                return "refused", line.removeprefix("distretarget: ").replace(str(path), name)
            return "FAILED", f"{name}: status {done.returncode}: {(line.splitlines() or [''])[-1]}"
        if fault := _fault(motion, output):
            return "FAILED", f"{name}: {fault}"
        frames = json.loads(figures.read_text())["frames"]
        copy, result = (1e3 * np.mean(frames[key]) for key in ("stress_copy", "stress"))
        return "ok", f"{len(frames['stress']):6d} frames {seconds:6.2f} s  {copy:8.2f} / {result:8.2f}   {name}"


def _fault(source: Motion | None, output: Path) -> str:
    """What is wrong with the written file; empty if nothing is."""
    if source is None:
        return "retargeted, but cannot be read"
    try:
        written = read_bvh(output)
    except DistretargetError as error:
        return str(error)
    found, expected = ((len(each), each.frame_time_text) for each in (written, source))
    return "" if found == expected else f"frames and frame time {found} written, {expected} expected"


@click.command(help=__doc__)
@click.argument("folder", type=Path)
@click.option("--only", default="*", help="Only files whose paths match, compared from the end.")
def main(folder: Path, only: str) -> None:
    """Print the outcome of every file, then the counts; exit with 1 if a file failed or there is none."""
    counts: Counter[str] = Counter()
    for path in sorted(folder.rglob("*.bvh")):
        if path.match(only):
            verdict, text = outcome(path, str(path.relative_to(folder)))
            counts[verdict] += 1
            print(f"{verdict:<8}{text}", flush=True)
    parts = " + ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS)
    print(f"{parts} = {counts.total()} files")
    sys.exit(1 if counts["FAILED"] or not counts else 0)


if __name__ == "__main__":
    main()
