"""Manual pages and completion: every command and option is in them."""

import os
import subprocess
import sys

import make_man
import pytest

from distretarget.cli import COMMANDS

PAGES = dict(make_man.pages())


def test_every_command_has_a_page():
    assert {"distretarget", *(f"distretarget-{name}" for name in COMMANDS), "distretarget-skeleton-match"} <= {*PAGES}


@pytest.mark.parametrize("name", PAGES)
def test_a_page_says_what_the_help_says(name):
    sections = [line for line in PAGES[name].splitlines() if line.startswith(".SH ")]
    assert sections[:3] == [".SH NAME", ".SH SYNOPSIS", ".SH DESCRIPTION"]
    assert r"\-\-help" in PAGES[name]
    assert "\b" not in PAGES[name]
    assert "\n\n" not in PAGES[name]


def test_the_shell_completes_commands_and_options():
    words = {"COMP_WORDS": "distretarget walk.bvh --sup", "COMP_CWORD": "2", "_DISTRETARGET_COMPLETE": "bash_complete"}
    command = [sys.executable, "-c", "from distretarget.__main__ import main; main()"]
    done = subprocess.run(command, env=os.environ | words, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("plain,--supports\n", "")
