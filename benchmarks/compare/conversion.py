"""Time reading, retargeting, metrics and writing; asv compares the times of two commits.

    cd benchmarks/compare && asv continuous --interleave-rounds main HEAD

asv installs the commits in an environment by turns, and runs the methods whose names start with `time_`. They measure
processor time, so that other programs matter less.
"""

import tempfile
import time
from pathlib import Path

from distretarget import Options, load_target, read_bvh, retarget, write_bvh

SAMPLES = Path(__file__).resolve().parents[2] / "sample_bvh"
PAPER = Options(objective="paper")


class _Conversion:
    clip = target = ""  # files of SAMPLES
    timeout = 600  # [s], which the first run needs for compiling
    timer = time.process_time
    rounds = 3

    def setup(self):
        self.folder = tempfile.TemporaryDirectory()
        self.written = Path(self.folder.name, "written.bvh")
        self.source, self.body = read_bvh(SAMPLES / self.clip), load_target(SAMPLES / self.target)
        retarget(self.source, self.body, PAPER)
        self.result = retarget(self.source, self.body)

    def teardown(self):
        self.folder.cleanup()

    def time_read(self):
        read_bvh(SAMPLES / self.clip)

    def time_retarget(self):
        retarget(self.source, self.body)

    def time_retarget_by_the_paper(self):
        retarget(self.source, self.body, PAPER)

    def time_metrics(self):
        self.result.metrics  # noqa: B018 - they are computed when they are asked for

    time_metrics.number = 1  # a result computes its metrics once, and `setup` makes a new one for each run
    time_metrics.warmup_time = 0

    def time_write(self):
        write_bvh(self.written, self.result.motion, overwrite=True)


class WalkOfAChild(_Conversion):
    clip, target = "walk.bvh", "child.json"


class ClapWithLongArms(_Conversion):
    clip, target = "clap.bvh", "long_arms.json"


class SquatOnMixamo(_Conversion):
    clip, target = "squat.bvh", "rigs/mixamo_a.json"
