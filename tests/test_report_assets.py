"""Templates, styles and modules of the pages: complete, without unused parts, with short lines."""

import hashlib
import re
import shutil
import subprocess
from pathlib import Path

import make_three
import pytest

import distretarget.report
from distretarget.report.page import LIBRARY, SCRIPTS, STYLES

FOLDER = Path(distretarget.report.__file__).parent
KINDS = (*SCRIPTS,)
SHARED = ("page.html", "player.html")
FILES = {
    path.name: path.read_text("utf-8")
    for path in sorted(FOLDER.iterdir())
    if path.suffix in (".html", ".css", ".js") and path.name != LIBRARY
}
CODE = {  # without comments
    name: re.sub(r"/\*.*?\*/|^\s*//[^\n]*", "", text, flags=re.DOTALL | re.MULTILINE)
    for name, text in FILES.items()
    if name.endswith(".js")
}
RULES = {  # without comments and declarations
    name: re.sub(r"\{[^{}]*\}", "{}", re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL))
    for name, text in FILES.items()
    if name.endswith(".css")
}
STYLE = FILES["style.css"]
IMPORTS = re.compile(r"^import \{(.*?)\} from '\./([\w.]+)';", re.MULTILINE | re.DOTALL)
EXPORTS = re.compile(r"^export (?:async )?(?:function|const|class) ([\w$]+)", re.MULTILINE)


def template_of(kind):
    return (FILES["page.html"] + FILES[f"{kind}.html"]).replace("{{player}}", FILES["player.html"])


def code_of(kind):
    return "\n".join(CODE[name] for name in SCRIPTS[kind])


def ids_of(kind):
    return re.findall(r'\bid="([\w-]+)"', template_of(kind))


def asked_by(code):
    quoted = r"\$\('([\w-]+)'\)|(?<!\.)(?:toggle|look|embedded)\('([\w-]+)'"
    lists = re.findall(r"for \(const id of \[(.*?)\]", code)
    return {a or b for a, b in re.findall(quoted, code)} | set(re.findall(r"'([\w-]+)'", " ".join(lists)))


def data_of(kind):
    return set(re.findall(r"embedded\('([\w-]+)'", code_of(kind)))


def names_in(code):
    return re.findall(r"^(?:export )?(?:async )?(?:function|const|let|class) ([\w$]+)", code, re.MULTILINE)


def test_every_file_belongs_to_a_page():
    assert {name for names in SCRIPTS.values() for name in names} == set(CODE)
    assert {name for names in STYLES.values() for name in names} == set(RULES)
    assert {f"{kind}.html" for kind in KINDS} | {*SHARED, *CODE, *RULES} == set(FILES)


@pytest.mark.parametrize("name", FILES)
def test_lines_are_short_and_end_in_no_space(name):
    for number, line in enumerate(FILES[name].splitlines(), 1):
        assert len(line) <= 120, f"{name}:{number}"
        assert line == line.rstrip(), f"{name}:{number}"
        assert "\t" not in line, f"{name}:{number}"


@pytest.mark.parametrize("name", CODE)
def test_a_module_can_be_read(name):
    if not (node := shutil.which("node")):
        pytest.skip("node, which reads the modules, is not installed")
    command = [node, "--input-type=module", "--check"]
    done = subprocess.run(command, input=FILES[name], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", CODE)
def test_a_module_imports_what_another_offers_and_it_uses(name):
    for names, module in IMPORTS.findall(FILES[name]):
        body = IMPORTS.sub("", CODE[name])
        for one in re.split(r",\s*", names.strip()):
            assert one in EXPORTS.findall(FILES[module]), one
            assert re.search(rf"(?<![\w$])(?<!\w\.){re.escape(one)}(?![\w$])", body), one
        for kind in KINDS:
            order = SCRIPTS[kind]
            if name in order:
                assert order.index(module) < order.index(name)


@pytest.mark.parametrize("kind", KINDS)
def test_every_name_of_a_page_has_one_meaning(kind):
    names = names_in(code_of(kind))
    assert len(names) == len(set(names)) >= 30 * bool(SCRIPTS[kind])


@pytest.mark.parametrize("name", CODE)
def test_every_name_of_a_module_is_used(name):
    pages = [code_of(kind) for kind in KINDS if name in SCRIPTS[kind]]
    for word in names_in(CODE[name]):
        used = rf"(?<![\w$])(?<!\w\.){re.escape(word)}(?![\w$])"
        assert max(len(re.findall(used, code)) for code in pages) > 1, word


@pytest.mark.parametrize("kind", KINDS)
def test_scripts_use_the_ids_of_the_template_and_the_template_has_no_other(kind):
    ids, code = ids_of(kind), code_of(kind)
    assert len(ids) == len(set(ids))
    assert not data_of(kind) & set(ids)
    assert asked_by("\n".join(CODE[name] for name in SCRIPTS[kind] if name != "dom.js")) <= {*ids, *data_of(kind)}
    named = re.findall(r'(?:for|aria-labelledby|aria-describedby)="([\w-]+)"|href="#([\w-]+)"', template_of(kind))
    named = {name for pair in named for name in pair if name}
    assert named <= set(ids)
    rules = "\n".join(RULES[name] for name in STYLES[kind])
    assert asked_by(code) | named | set(re.findall(r"#([\w-]+)", rules)) >= set(ids)


@pytest.mark.parametrize("name", RULES)
def test_a_style_has_no_class_and_no_id_that_nothing_has(name):
    kinds = [kind for kind in KINDS if name in STYLES[kind]]
    there = {word for kind in kinds for word in re.findall(r"[\w-]+", template_of(kind) + code_of(kind))}
    assert set(re.findall(r"\.([a-z][\w-]*)", RULES[name])) <= there | {"of-a", "of-b"}
    assert set(re.findall(r"#([\w-]+)", RULES[name])) <= {one for kind in kinds for one in ids_of(kind)}


def test_colours_are_used_and_have_a_light_and_a_dark_value():
    colours = dict(re.findall(r"--([\w-]+): ([^;]+);", STYLE))
    assert all(re.fullmatch(r"light-dark\(#[0-9a-f]+, #[0-9a-f]+\)", colour) for colour in colours.values())
    read = set(re.findall(r"var\(--([\w-]+)\)", "\n".join(FILES[name] for name in RULES)))
    used = read | set(re.findall(r"'([\w-]+)'", "".join(CODE.values())))
    assert read <= set(colours) <= used


def test_the_library_is_the_one_that_the_script_makes_and_its_licence_stands_beside_it():
    content = (FOLDER / LIBRARY).read_bytes()
    assert hashlib.sha256(content).hexdigest() == make_three.SHA256
    assert make_three.THREE in content[:100].decode()
    assert "MIT" in (FOLDER / "three.LICENSE.txt").read_text("utf-8")
    assert not re.search(rb"</script|<!--|\r", content)
