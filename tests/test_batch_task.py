"""The conversion of one clip by a worker: its outcome is that of `retarget`, or says what went wrong."""

from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool

import pytest
from bodies import other_lengths, person, swaying

from distretarget import retarget
from distretarget.batch import task as batch_task
from distretarget.batch.task import Task, convert
from distretarget.io.bvh import parse_bvh
from distretarget.io.bvh_writer import format_bvh
from distretarget.io.files import Text
from distretarget.io.map_json import MapFile
from distretarget.io.target_file import skeleton_to_json
from distretarget.pipeline.options import Options
from distretarget.report.document import About

TARGET = Text(skeleton_to_json(other_lengths(person()), "body"), "body.json")


def task_of(text, target=TARGET, **others):
    return Task(source=Text(text, "in.bvh"), target=target, map=MapFile({}, ""), options=Options(), **others)


def test_a_task_does_what_retargeting_does():
    motion = swaying(person())
    text = format_bvh(motion)
    outcome = convert(task_of(text))
    assert (outcome.error, outcome.frames) == ("", 20)
    source = parse_bvh(text, "in.bvh")
    assert outcome.bvh == format_bvh(retarget(source, other_lengths(person())).motion)
    assert outcome.figures["result"]["bone_error"] < 1e-9
    assert "<title>" in convert(task_of(text, about=About(a="a", b="b", command="", version="1"))).report
    with ThreadPoolExecutor(2) as pool:
        assert convert(task_of(text), pool.map).bvh == outcome.bvh


def test_a_task_says_what_went_wrong(monkeypatch):
    assert convert(task_of("HIERARCHY")).error.startswith("in.bvh:1: ")
    assert convert(task_of(format_bvh(swaying(person())), Text("{}", "body.json"))).error.startswith("body.json: ")

    def fail(*_):
        raise ZeroDivisionError("two\nlines")

    monkeypatch.setattr(batch_task, "parse_bvh", fail)
    assert convert(task_of("")).error == "in.bvh: unexpected ZeroDivisionError: two lines; please report this"


def test_a_task_leaves_dead_workers_to_the_run():
    def broken(*_):
        raise BrokenProcessPool("died")

    with pytest.raises(BrokenProcessPool):
        convert(task_of(format_bvh(swaying(person()))), broken)
