"""Workflows, forms and hooks: they are valid, and what they name exists."""

import re
import subprocess
import sys
import tomllib

import pytest
import yaml
from bodies import ROOT

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
