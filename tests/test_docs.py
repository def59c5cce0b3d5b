"""The manual: it is up to date with commands, messages and tables, its examples run, and what is named exists."""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib

import make_docs
import make_errors
import make_man
import pytest
import yaml
from bodies import ROOT, SAMPLES, sample
from make_docs import lines
from make_errors import CURES, NOT_MESSAGES
from make_samples import CHARACTERS
from program import run

import distretarget
from distretarget import write_bvh
from distretarget.cli import COMMANDS
from distretarget.io.files import REASONS

PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])
WITH_EXAMPLES = [page for page in PAGES if page.name != "CONTRIBUTING.md"]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
HEADING = re.compile(r"^#", re.MULTILINE)
PROGRAM = re.compile(r"(?:^|&& )distretarget (.+)$")


def each(pages):
    return pytest.mark.parametrize("page", pages, ids=lambda page: page.name)


def run_line(line):
    """Run a shell line of an example if it calls the program; any other line has to be in `.ci/run`."""
    found = PROGRAM.search(line)
    if not found:
        assert line in (ROOT / ".ci" / "run").read_text().splitlines()
        return ""
    done = run(*shlex.split(found[1]))
    assert done.returncode == 0, f"{line}: {done.stderr or done.stdout}"
    return done.stdout


def without_times(text):
    """The lines of an output, without the times that differ from run to run."""
    return [re.sub(r"[\d.]+ s\b", "# s", line).rstrip() for line in text.splitlines()]


def examples(page):
    """The blocks of a page: language, text, and whether no heading stands between it and the block before."""
    text, end = page.read_text("utf-8"), 0
    for block in BLOCK.finditer(text):
        yield block[1], block[2], not HEADING.search(text[end : block.start()])
        end = block.end()


def anchors(page):
    """The addresses of the headings of a page."""
    text = BLOCK.sub("", page.read_text("utf-8"))
    return {
        re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-")
        for title in re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    }


def test_generated_parts_are_up_to_date():
    for path, text in make_docs.documents().items():
        assert path.read_text("utf-8") == text, f"{path.name}: run tools/make_docs.py"
    assert make_errors.PAGE.read_text("utf-8") == make_errors.page(), "run tools/make_errors.py"


def test_the_symbols_of_the_method_name_what_is_in_the_code():
    code = "\n".join(path.read_text("utf-8") for path in (ROOT / "distretarget").rglob("*.py"))
    rows = re.findall(r"^\| \$.+?\$ \| (`.+?) \|", (ROOT / "docs" / "method.md").read_text("utf-8"), re.MULTILINE)
    names = {name for row in rows for name in re.findall(r"`([\w.]+)`", row)}
    assert len(names) > 30
    words = {*re.findall(r"\w+", code)}
    assert {name for name in names if not name.endswith(".py") and not {*name.split(".")} <= words} == set()


def test_the_api_page_has_every_public_name():
    names = re.findall(r"^::: distretarget\.(\w+)$", (ROOT / "docs" / "api.md").read_text("utf-8"), re.MULTILINE)
    assert sorted(names) == sorted(distretarget.__all__)


@each(WITH_EXAMPLES)
def test_every_example_runs_and_prints_what_the_page_says(page, tmp_path, monkeypatch):
    for folder in (SAMPLES, CHARACTERS):
        shutil.copytree(folder, tmp_path / folder.name)
    monkeypatch.chdir(tmp_path)
    names, printed = {}, None
    for language, text, follows in examples(page):
        if language == "text" and printed is not None and follows:
            assert [line for line in without_times(text) if line not in ("", "...", *printed)] == []
        printed = None
        if language == "sh":
            printed = without_times("\n".join(map(run_line, text.splitlines())))
        if language == "python":
            if "import pandas" in text:
                pytest.importorskip("pandas")
            exec(compile(text, page.name, "exec"), names)


def test_the_example_for_three_js_runs(tmp_path):
    """Needs `npm install three` in the folder of the project."""
    if not shutil.which("node") or not (ROOT / "node_modules" / "three").is_dir():
        pytest.skip("node or three.js is not installed")
    page = (ROOT / "docs" / "programs.md").read_text("utf-8")
    (block,) = (text for language, text in BLOCK.findall(page) if language == "js")
    write_bvh(tmp_path / "clap_long_arms.bvh", sample("clap"))
    (tmp_path / "node_modules").symlink_to(ROOT / "node_modules")
    (tmp_path / "play.mjs").write_text(block + "console.log(skeleton.bones.length, clip.duration);\n")
    played = subprocess.run(["node", "play.mjs"], cwd=tmp_path, capture_output=True, text=True)
    assert played.returncode == 0, played.stderr
    bones, duration = map(float, played.stdout.split())
    assert bones >= 22
    assert duration == pytest.approx(276 * 0.016667, rel=1e-3)


@each(PAGES)
def test_links_lead_to_files_and_headings(page):
    text = BLOCK.sub("", page.read_text("utf-8"))
    links = re.findall(r"""(?:\]\(|(?:src|srcset|href)=")([^)\s"]+)""", text)
    for link in links:
        if not link.startswith("https://"):
            path, _, anchor = link.partition("#")
            target = page.parent / path if path else page
            assert target.exists(), link
            assert not anchor or anchor in anchors(target), link


@each(sorted(ROOT.glob("docs/*.md")))
def test_every_page_is_on_the_site(page):
    assert f": {page.name}\n" in (ROOT / "mkdocs.yml").read_text("utf-8"), "add it to `nav` in mkdocs.yml"


def test_pictures_are_small():
    pictures = [path for path in (ROOT / "docs" / "pictures").rglob("*") if path.is_file()]
    assert max(path.stat().st_size for path in pictures) < 2e6
    assert sum(path.stat().st_size for path in pictures) < 6.1e6


MAN = dict(make_man.pages())


@pytest.mark.parametrize("name", MAN)
def test_a_page_says_what_the_help_says(name):
    sections = [line for line in MAN[name].splitlines() if line.startswith(".SH ")]
    assert sections[:3] == [".SH NAME", ".SH SYNOPSIS", ".SH DESCRIPTION"]
    assert r"\-\-help" in MAN[name]
    assert "\b" not in MAN[name]
    assert "\n\n" not in MAN[name]
    assert {"distretarget", *(f"distretarget-{name}" for name in COMMANDS), "distretarget-skeleton-match"} <= {*MAN}


def test_the_shell_completes_commands_and_options():
    words = {"COMP_WORDS": "distretarget walk.bvh --sup", "COMP_CWORD": "2", "_DISTRETARGET_COMPLETE": "bash_complete"}
    command = [sys.executable, "-c", "from distretarget.__main__ import main; main()"]
    done = subprocess.run(command, env=os.environ | words, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("plain,--supports\n", "")


def test_nothing_is_told_of_messages_that_are_gone():
    texts = {message.text for message in make_errors.messages()} | set(REASONS.values())
    assert set(CURES) <= texts
    assert not NOT_MESSAGES & texts


METHODS = ("source", "copy", "paper", "contact")


def numbers(cell):
    """The numbers in a cell, in their order."""
    return [float(number) for number in re.findall(r"\d+\.?\d*", cell.replace(",", ""))]


def summary(start, method):
    """The mean in the row of the summary that begins so, for a method."""
    row = next(row for row in lines("summary") if row[0].startswith(start))
    return numbers(row[1 + METHODS.index(method)])[0]


def column(table, place, number):
    """The numbers at a place of the cells in a column of a table; rows with `-` have none."""
    return [numbers(row[place])[number] for row in lines(table)[1:] if not row[place].startswith("-")]


CHANGES = {
    r"contacts are off by ([\d.]+) of what": lambda: (
        summary("contact error", "contact") / summary("contact error", "copy")
    ),
    r"at a mean direction error of ([\d.]+) degrees": lambda: summary("direction error", "contact"),
    r"they slide as much as the source's, ([\d.]+) times": lambda: (
        summary("foot skate", "copy") / summary("foot skate", "source")
    ),
    r"a leg apart, are (\d+) to": lambda: min(column("duets", 1, 2)),
    r"a leg apart, are \d+ to (\d+) %": lambda: max(column("duets", 1, 2)),
    r"retargeted alone, and (\d) to": lambda: min(column("duets", 1, 3)),
    r"retargeted alone, and \d to (\d) %": lambda: max(column("duets", 1, 3)),
    r"put\s+them up to (\d+) % off": lambda: max(column("supports", 1, 0)),
}


@pytest.mark.parametrize(("pattern", "value"), CHANGES.items(), ids=CHANGES)
def test_a_number_in_the_prose_is_that_of_the_table(pattern, value):
    found = re.search(pattern.replace(" ", r"\s+"), (ROOT / "CHANGELOG.md").read_text("utf-8"))
    assert found, "the sentence has changed: change it here as well"
    digits = len(found[1].partition(".")[2])
    assert found[1] == f"{value():.{digits}f}"


GITHUB = ROOT / ".github"
WORKFLOWS = {path.stem: path.read_text("utf-8") for path in (GITHUB / "workflows").glob("*.yml")}
OTHERS = [ROOT / ".pre-commit-config.yaml", *GITHUB.glob("*.*"), *GITHUB.glob("ISSUE_TEMPLATE/*")]
TEXTS = WORKFLOWS | {path.stem: path.read_text("utf-8") for path in OTHERS}
SCHEMAS = {
    "vendor.github-workflows": "workflows/*.yml",
    "custom.github-workflows-require-timeout": "workflows/*.yml",
    "vendor.github-issue-forms": "ISSUE_TEMPLATE/[!c]*.yml",  # all but config.yml
    "vendor.github-issue-config": "ISSUE_TEMPLATE/config.yml",
    "vendor.dependabot": "dependabot.yml",
}


@pytest.mark.parametrize("schema", SCHEMAS)
def test_files_are_valid(schema):
    pytest.importorskip("check_jsonschema", reason="check-jsonschema is not installed")
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", schema, *GITHUB.glob(SCHEMAS[schema])]
    checked = subprocess.run(command, capture_output=True, text=True)
    assert checked.returncode == 0, checked.stdout


@pytest.mark.parametrize("name", WORKFLOWS)
def test_workflows_only_read_and_pin_their_actions(name):
    assert yaml.safe_load(WORKFLOWS[name])["permissions"] == {"contents": "read"}
    assert all(re.search(r"@(release/)?v\d+$", action) for action in re.findall(r"uses: (\S+)", WORKFLOWS[name]))


def test_checks_run_on_the_versions_of_python_that_the_package_lists():
    classifiers = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["classifiers"]
    matrix = yaml.safe_load(WORKFLOWS["checks"])["jobs"]["checks"]["strategy"]["matrix"]
    assert matrix["python"] == re.findall(r"Python :: (3\.\d+)", " ".join(classifiers))


def test_a_release_runs_the_first_command_of_the_front_page():
    command = re.search(r".*pip install.*", (ROOT / "README.md").read_text("utf-8"))[0]
    assert "pip install -q . " in command  # where release.yml puts the wheel
    assert f"test -s {command.split()[-1]}\n" in WORKFLOWS["release"]


@pytest.mark.parametrize("name", TEXTS)
def test_paths_exist(name):
    text = re.sub(r"https://(github\.com/distretarget/distretarget/blob/main/|\S+)", "", TEXTS[name])
    folders = "|".join(re.escape(folder.name) for folder in ROOT.iterdir() if folder.is_dir())
    for path in re.findall(rf"(?<![\w/.-])(?:{folders})/[\w./-]*\w|\b[\w/]+\.(?:md|py|toml|yml|cff)\b", text):
        assert (ROOT / path).exists() or path.startswith("out/"), path


@pytest.mark.parametrize("name", ["run", "pythons"])
def test_tests_that_checks_choose_exist(name):
    chosen = re.search(r"tests/test_\{(.*?)\}\.py", (ROOT / ".ci" / name).read_text("utf-8")).group(1).split(",")
    assert [test for test in chosen if not (ROOT / "tests" / f"test_{test}.py").exists()] == []
