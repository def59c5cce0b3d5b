"""Run the program as users do: in this process, which is fast, or in a separate one."""

import subprocess
import sys
from contextlib import closing
from pathlib import Path
from unittest.mock import patch

import pytest
from click.testing import CliRunner

from distretarget.batch.results import Database
from distretarget.cli import main

LOOK = 0.02  # time between two checks of a running process [s]
LOOKS = 15_000  # after this many seconds a test fails


def run(*arguments, given=""):
    """Run the program in this process, with the text `given` as standard input."""
    words = list(map(str, arguments))
    with CliRunner().isolation(given) as (out, err, *_), patch("sys.argv", ["distretarget", *words]):
        with pytest.raises(SystemExit) as ended:
            main()
        texts = [stream.getvalue().decode() for stream in (out, err)]
    return subprocess.CompletedProcess(words, ended.value.code or 0, *texts)


def succeeded(*arguments, given=""):
    """What the program, run so, did without an error."""
    done = run(*arguments, given=given)
    assert done.returncode == 0, done.stderr
    return done


def refused(*arguments, status=1, given=""):
    """The line with which the program, run so, ends; all files of the working folder are as before."""
    before = contents()
    done = run(*arguments, given=given)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (status, "", 1), done.stderr
    assert done.stderr.startswith("distretarget: ")
    assert contents() == before
    return done.stderr


def contents():
    """The content of each regular file in the working folder, and which files are there."""
    return {path: path.read_bytes() if path.is_file() else None for path in Path().rglob("*")}


def command(*arguments):
    """The command line that starts the program in a separate process."""
    return [sys.executable, "-m", "distretarget", *map(str, arguments)]


def run_process(*arguments, **options):
    """Run the program in a separate process, with options of `subprocess.run`."""
    return subprocess.run(command(*arguments), capture_output=True, text=True, **options)


def start_process(*arguments):
    """Start the program in a separate process and session."""
    pipe = subprocess.PIPE
    return subprocess.Popen(command(*arguments), stdout=pipe, stderr=pipe, text=True, start_new_session=True)


def wait_until(condition, process):
    """Wait until a condition holds or the process has ended."""
    for _ in range(LOOKS):
        if condition():
            return
        try:
            process.wait(LOOK)
        except subprocess.TimeoutExpired:
            continue
        return
    pytest.fail(f"the condition did not come true in {LOOKS * LOOK:.0f} s")


def last_records(folder):
    """The newest record of each clip in a folder of results."""
    with closing(Database(folder, read_only=True)) as database:
        return {record["output"]: record for record in database.latest()}
