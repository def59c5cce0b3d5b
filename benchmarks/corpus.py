"""Retarget every BVH file below a folder to its own body with longer arms and shorter legs.

    python benchmarks/corpus.py FOLDER [--only GLOB]

Prints a line per file: `ok`, number of frames, seconds including start-up, mean stress x 1000 of the rotation copy and
of the result, and the file's name; or `refused`, if the program refuses the file in one line, and that line; or
`FAILED` for anything else. The exit status is 1 if a file failed.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from edits import ARMS_AND_LEGS, edited

from distretarget import DistretargetError, Motion, read_bvh
from distretarget.io.target_file import skeleton_to_json

STRESSES = ("stress_copy", "stress")
VERDICTS = ("ok", "refused", "FAILED")


@dataclass(frozen=True)
class Outcome:
    """The verdict on a file, and the text printed after it."""

    verdict: str
    text: str

    def __str__(self) -> str:
        return f"{self.verdict:<8}{self.text}"


def outcome(path: Path, name: str) -> Outcome:
    """Run the command line on a file; judge its exit status, messages and output."""
    motion = _motion(path)
    with tempfile.TemporaryDirectory(prefix="corpus-") as scratch:
        target, output, figures = (Path(scratch, name) for name in ("target.json", "out.bvh", "out.json"))
        if motion:
            body = edited(motion.rigid_skeleton, ARMS_AND_LEGS)
            target.write_text(skeleton_to_json(body, "target"), encoding="utf-8", errors="surrogateescape")
        started = time.perf_counter()
        done = _run(path, target if motion else path, "-o", output, "--json", figures)
        seconds = time.perf_counter() - started
        if done.returncode == 0:
            fault = _fault(motion, output)
            return Outcome("FAILED", f"{name}: {fault}") if fault else _ok(figures, seconds, name)
        return _refusal(done, output, path, name)


def _motion(path: Path) -> Motion | None:
    """The motion; None if the file cannot be read."""
    try:
        return read_bvh(path)
    except DistretargetError:
        return None


def _run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "distretarget", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=600)


def _fault(source: Motion | None, output: Path) -> str:
    """What is wrong with the written file; empty if nothing is."""
    if source is None:
        return "retargeted, but cannot be read"
    try:
        written = read_bvh(output)
    except DistretargetError as error:
        return str(error)
    if len(written) != len(source):
        return f"{len(written)} frames written, {len(source)} expected"
    if written.frame_time_text != source.frame_time_text:
        return f"frame time {written.frame_time_text} written, {source.frame_time_text} expected"
    return ""


def _ok(figures: Path, seconds: float, name: str) -> Outcome:
    frames = json.loads(figures.read_text())["frames"]
    stresses = " / ".join(f"{1e3 * np.mean(frames[key]):8.2f}" for key in STRESSES)
    return Outcome("ok", f"{len(frames[STRESSES[0]]):6d} frames {seconds:6.2f} s  {stresses}   {name}")


def _refusal(done: subprocess.CompletedProcess[str], output: Path, path: Path, name: str) -> Outcome:
    """Judge a run that failed: a refusal has exit status 1, one error line that names the file, and no output."""
    line = done.stderr.strip()
    one_line = "\n" not in line and line.startswith(f"distretarget: {path}:")
    if done.returncode == 1 and one_line and not done.stdout and not output.exists():
        return Outcome("refused", line.removeprefix("distretarget: ").replace(str(path), name))
    return Outcome("FAILED", f"{name}: status {done.returncode}: {(line.splitlines() or [''])[-1]}")


def main() -> int:
    """Print the outcome of every file, then the counts; return 1 if a file failed or there is none."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    parser.add_argument(
        "--only", default="*", metavar="GLOB", help="only files whose paths match, compared from the end"
    )
    args = parser.parse_args()
    counts: Counter[str] = Counter()
    for path in sorted(args.folder.rglob("*.bvh")):
        if path.match(args.only):
            result = outcome(path, str(path.relative_to(args.folder)))
            counts[result.verdict] += 1
            print(result, flush=True)
    parts = " + ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS)
    print(f"{parts} = {counts.total()} files")
    return 1 if counts["FAILED"] or not counts else 0


if __name__ == "__main__":
    sys.exit(main())
