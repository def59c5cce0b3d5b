"""The studio: files in, a result out that is the command line's to the byte, and nobody else let in."""

import http.client
import io
import json
import os
import re
import shlex
import socket
import subprocess
import sys
import tempfile
import threading
import time
import tomllib
import zipfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from urllib.parse import quote, urlsplit

import numpy as np
import pytest
from bodies import HERO, SAMPLES, person
from click.testing import CliRunner
from fbx_text import Node, fbx
from pages import PATIENCE, settle, wait_until_true

from distretarget.cli import cli
from distretarget.errors import DistretargetError, FileError, SettingsError
from distretarget.io.input_file import load_file
from distretarget.io.map_json import rest_pose_in
from distretarget.io.reading import animations_in, load_target, parse_motion, read_motion
from distretarget.report.actors import without_known
from distretarget.studio.order import Order
from distretarget.studio.server import SAMPLES as OFFERED
from distretarget.studio.session import Session, SupersededError

WAVE = SAMPLES / "wave.bvh"
TOKEN = "secret"
PLAIN = "distretarget clap.bvh hero.glb -o clap_hero.glb"


class Dropped(Session):
    """A session with a clip and a character."""

    def __init__(self, clip=WAVE, character=HERO, names=("", "")):
        super().__init__()
        given = zip(("clip", "character"), (clip, character), names, strict=True)
        self.files = {role: self.add(name or path.name, path.read_bytes())["id"] for role, path, name in given}

    def ordered(self, tab="", **more):
        """What becomes of an order for both files, with more fields."""
        return self.carry_out(Order.of(self.files | more), tab)


@pytest.fixture(scope="module")
def session():
    """A session with the wave and the hero, which several tests share."""
    return Dropped()


@contextmanager
def serving(session):
    """The address of a studio that answers."""
    uvicorn = pytest.importorskip("uvicorn")
    from distretarget.studio.server import studio_app

    listening = socket.create_server(("127.0.0.1", 0))
    port = listening.getsockname()[1]
    app = studio_app(TOKEN, port, session)
    server = uvicorn.Server(uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=1))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]}, daemon=True)
    thread.start()
    while not server.started:
        time.sleep(0.01)
    yield f"http://127.0.0.1:{port}/{TOKEN}/"
    server.should_exit = True
    thread.join(10)


@pytest.fixture
def studio():
    """The address of an empty studio."""
    with serving(Session()) as address:
        yield address


def answer(studio, path, content=None, **headers):
    """Status, headers and text of what the studio answers to a request for a path from its root."""
    host = urlsplit(studio).netloc
    connection = http.client.HTTPConnection(host)
    headers = {"Host": host} | {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request("GET" if content is None else "POST", path, content, headers)
    response = connection.getresponse()
    found = response.status, response.headers, response.read().decode()
    connection.close()
    return found


def in_shell(folder, command):
    """What a shell says of a command in a folder."""
    program = folder / "distretarget"
    program.write_text(f"#!/bin/sh\nexec '{sys.executable}' -m distretarget \"$@\"\n")
    program.chmod(0o755)
    path = f"{folder}{os.pathsep}{os.environ['PATH']}"
    ran = subprocess.run(["sh", "-c", command], cwd=folder, env={**os.environ, "PATH": path}, capture_output=True)
    program.unlink()
    return ran


def by_command(folder, session, done):
    """The bytes that the command of an order makes, by a shell in a folder with what is taken away in a zip."""
    with zipfile.ZipFile(io.BytesIO(session.bundle([done.order], with_files=True)[1])) as archive:
        archive.extractall(folder)
    ran = in_shell(folder / "made_from", done.names.command(done.order))
    assert ran.returncode == 0, ran.stderr
    return (folder / "made_from" / done.names.result).read_bytes()


@pytest.mark.parametrize(
    "more",
    [
        {},
        {"edits": {"mirror": True, "start": "10f", "end": 2.0, "speed": 0.5}, "in_place": True},
        {"options": {"supports": "free", "skin": "none"}},
        {"contacts": [{"between": ["right hand", "head"], "gap": 0, "frames": [40, 60]}]},
        {
            "contacts": [
                {"between": ["right hand", "trunk"], "gap": 2, "anchors": [[0.4, 0], [0.8, -12.5]], "frames": [40, 60]}
            ]
        },
        {"contacts": [{"plant": "left foot", "keep": False}], "map": {"LeftHand": None}},
        {"format": "npz", "in_place": True},
        {"format": "bvh", "edits": {"turn": -90.0}},
        {"format": "vrma"},
        {"format": "gltf"},
    ],
)
def test_what_is_taken_away_is_what_its_command_makes(tmp_path, session, more):
    done = session.ordered(**more)
    name, content = done.file(more.get("format", "glb"))
    assert name == f"wave_hero.{more.get('format', 'glb')}"
    assert content == by_command(tmp_path, session, done)


@pytest.mark.parametrize("merged", [False, True])
def test_several_clips_are_taken_as_their_commands_make_them(tmp_path, merged):
    session = Dropped()
    other = session.add("wave.bvh", (SAMPLES / "clap.bvh").read_bytes())
    assert other["name"] == "wave1.bvh"
    contacts = [{"plant": "left foot", "keep": False}]
    changes = ({"contacts": contacts}, {"clip": other["id"], "edits": {"end": "60f"}}, {"map": {"Head": None}})
    orders = [Order.of(session.files | more) for more in changes]
    name, content = session.bundle(orders, merged, with_files=True)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        archive.extractall(tmp_path)
    results = ["hero_clips.glb"] if merged else ["wave_hero.glb", "wave1_hero.glb", "wave_hero1.glb"]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*results, "made_from"])
    assert name == ("hero_clips.zip" if merged else "clips.zip")
    made = tmp_path / "made_from"
    command = (made / "command.txt").read_text().strip()
    assert command == session.command(orders, merged)
    ran = in_shell(made, command)
    assert ran.returncode == 0, ran.stderr
    for result in results:
        assert (made / result).read_bytes() == (tmp_path / result).read_bytes()
    if merged:
        assert session.bundle(orders, merged) == (results[0], (made / results[0]).read_bytes())
        file = load_file(made / results[0])
        assert animations_in(file) == ("wave", "wave1", "wave 2")
        for number, order in enumerate(orders, start=1):
            motion, _ = parse_motion(file, f"#{number}", None)
            expected = session.carry_out(order).converted.result.motion
            assert motion.positions == pytest.approx(expected.positions, abs=1e-5)


def test_what_holds_one_motion_takes_no_other(session):
    orders = [Order.of(session.files | {"format": "bvh"})] * 2
    with pytest.raises(SettingsError, match="holds one motion"):
        session.bundle(orders, merged=True)


@pytest.mark.skipif(os.name == "nt", reason="names that Windows cannot have")
@pytest.mark.parametrize(
    ("clip", "character"),
    [
        ("-o.bvh", "--help.glb"),
        ("batch", "a b; $(echo no) 'quoted' \"twice\" *.glb"),
        ("two\nlines.bvh", "é漢字.glb"),
        ("same.bvh", "Same.bvh"),
        ("../..", "."),
        (f"{'long' * 60}.bvh", f"{'name' * 60}.glb"),
        ("a.bvh", "a.contacts.json.glb"),
    ],
)
def test_files_with_odd_names_make_the_same_by_a_shell(tmp_path, clip, character):
    contacts = [{"plant": "left foot", "keep": False}]
    session = Dropped(names=(clip, character))
    done = session.ordered(edits={"end": "30f"}, contacts=contacts, map={"Head": None})
    name, content = done.file(done.format)
    assert content == by_command(tmp_path, session, done)
    project = done.file("project")[0]
    (tmp_path / "made_from" / name).unlink()
    ran = in_shell(tmp_path / "made_from", f"distretarget retarget --project {shlex.quote(f'./{project}')}")
    assert ran.returncode == 0, ran.stderr
    assert (tmp_path / "made_from" / name).read_bytes() == content


def test_orders_that_go_on_from_others_give_the_same_to_the_bit(session):
    for entries in (
        [],
        [{"between": ["right hand", "head"], "gap": 0, "frames": [40, 60]}],
        [{"plant": "left foot", "keep": False, "frames": [5, 30]}],
        [{"between": ["left hand", "right hand"], "keep": False}, {"look": "head", "like": "source"}],
    ):
        done, other = session.ordered(contacts=entries), Dropped().ordered(contacts=entries)
        assert done.conversion is session.ordered().conversion
        assert done.file("glb") == other.file("glb")
        assert (done.motions, done.as_data) == (other.motions, other.as_data)


def test_a_page_gets_only_actors_and_bodies_that_it_does_not_have(session):
    first = session.ordered().motions
    known = {one["hash"] for key in ("actors", "bodies") for one in first[key]}
    changed = session.ordered(contacts=[{"between": ["right hand", "head"], "gap": 0, "frames": [40, 60]}]).motions
    short = without_known(changed, known)
    assert short["bodies"] == [one["hash"] for one in changed["bodies"]]
    assert (short["actors"][0], short["actors"][-1]) == (changed["actors"][0]["hash"], changed["actors"][-1])
    assert without_known(changed, ()) == changed


def test_the_rest_pose_of_a_clip_goes_into_its_map(tmp_path, session):
    rest = dict(rest_pose_in(load_file(SAMPLES / "walk.bvh")).rotations)
    done = session.ordered(rest=rest)
    assert done.file("glb")[1] != session.ordered(rest=None).file("glb")[1]
    assert done.file("glb")[1] == by_command(tmp_path / "made", session, done)
    assert json.loads(done.file("map")[1]) == {"format": "distretarget-map", "version": 1, "map": {}, "rest": rest}
    project = tmp_path / "made" / "made_from" / "wave_hero.project.json"
    (project.parent / done.names.result).unlink()
    assert in_shell(project.parent, f"distretarget retarget --project {project.name}").returncode == 0
    assert (project.parent / done.names.result).read_bytes() == done.file("glb")[1]


def test_the_papers_objective_has_no_supports_in_its_command(session):
    done = session.ordered(options={"objective": "paper", "supports": "feet"})
    assert done.names.command(done.order) == "distretarget wave.bvh hero.glb -o wave_hero.glb --objective paper"


def test_a_project_is_refused_with_other_files(tmp_path, session):
    done = session.ordered(edits={"end": "30f"})
    path = tmp_path / "wave.project.json"
    path.write_bytes(session.project([done.order, Order.of(session.files)])[1])
    for source in (WAVE, HERO):
        (tmp_path / source.name).write_bytes(source.read_bytes())
    whole = json.loads(path.read_text())

    def said(change, *more):
        path.write_text(json.dumps({**whole, **change}))
        ran = CliRunner().invoke(cli, ["retarget", "--project", str(path), "-o", str(tmp_path / "out.bvh"), *more])
        return str(ran.exception) if ran.exception else ""

    assert not said({})
    assert "-o" not in said({}, "--overwrite", "--speed", "2")
    assert "unknown key" in said({"colour": 1})
    assert "speed" in said({"edits": {"speed": -1}})
    assert "expected the name of a file beside" in said(
        {"files": {**whole["files"], "clip": {"name": "../x", "hash": ""}}}
    )
    (tmp_path / "wave.bvh").write_bytes(WAVE.read_bytes() + b"\n")
    assert "its content differs" in said({})
    (tmp_path / "wave.bvh").unlink()
    assert "belongs beside it" in said({})


def test_a_contact_that_is_dropped_is_marked_and_one_that_is_made_is_added(session):
    found = session.ordered().as_data["contacts"]
    assert {each["mark"] for each in found} == {"found"}
    gone = found[0]["entry"]
    key = "plant" if "plant" in gone else "between"
    entries = [
        {key: gone[key], "frames": gone["frames"], "keep": False},
        {"between": ["left hand", "right hand"], "frames": [5, 9], "gap": 1},
    ]
    marked = session.ordered(contacts=entries).as_data["contacts"]
    marks = {(each["mark"], tuple(each["parts"]), *each["entry"]["frames"]) for each in marked}
    assert ("dropped", tuple(found[0]["parts"]), *gone["frames"]) in marks
    assert ("added", ("left hand", "right hand"), 5, 9) in marks


@pytest.mark.parametrize(
    "given",
    [
        [],
        {},
        {"clip": "a", "character": "b", "path": "/etc/passwd"},
        {"clip": "a", "character": "b", "edits": {"speed": -1}},
        {"clip": "a", "character": "b", "edits": {"colour": 1}},
        {"clip": "a", "character": "b", "options": {"skin": "thick"}},
        {"clip": "a", "character": "b", "contacts": [{"between": "hands"}]},
        {"clip": "a", "character": "b", "map": {"Hips": 3}},
        {"clip": "a", "character": "b", "map": ["Hips"]},
        {"clip": "a", "character": "b", "format": 3},
        {"clip": "a", "character": "b", "animation": 3},
    ],
)
def test_orders_without_sense_are_refused(given):
    with pytest.raises(DistretargetError):
        Order.of(given)


def test_a_file_is_what_it_holds_and_nothing_to_use_is_refused():
    session = Session()
    assert session.add("hero.glb", HERO.read_bytes())["character"]
    walk = session.add("..\\..\\walk.bvh", (SAMPLES / "walk.bvh").read_bytes())
    assert (walk["name"], walk["clip"], walk["frames"]) == ("walk.bvh", True, 249)
    for content in (b"", b"\0" * 100, b"HIERARCHY", b"{}", np.random.default_rng(0).bytes(1000)):
        with pytest.raises(DistretargetError):
            session.add("file.bvh", content)
    assert len(session.dropped) == 2


def test_a_superseded_order_ends_early():
    session = Dropped(SAMPLES / "walk.bvh", SAMPLES / "child.json")

    def outcome(turn):
        try:
            session.ordered(edits={"turn": float(turn + 1)})
        except SupersededError:
            return "superseded"
        return "done"

    with ThreadPoolExecutor(8) as pool:
        outcomes = [*pool.map(outcome, range(8))]
    assert outcomes.count("done") >= 1
    assert "superseded" in outcomes


def test_orders_of_other_tabs_supersede_none():
    session = Dropped(WAVE, SAMPLES / "child.json")
    with ThreadPoolExecutor(3) as pool:
        done = pool.map(lambda tab: session.ordered(str(tab), edits={"turn": float(tab)}), range(3))
    assert len([*done]) == 3


def test_only_who_knows_the_token_gets_an_answer(studio):
    status, headers, _ = answer(studio, f"/{TOKEN}/")
    assert status == 200
    assert "script-src 'self'" in headers["content-security-policy"]
    assert "unsafe" not in headers["content-security-policy"]
    inside = (f"/{TOKEN}/assets/{name}" for name in ("../session.py", "server.py", "%2e%2e/session.py"))
    for path in ("/", "/wrong/", "/wrong/assets/studio.js", *inside):
        assert answer(studio, path)[0] == 404
    port = urlsplit(studio).port
    for host in ("evil.example", f"evil.example:{port}", "127.0.0.1"):
        assert answer(studio, f"/{TOKEN}/", Host=host)[0] == 404
    for origin in ("http://evil.example", "null", f"https://127.0.0.1:{port}"):
        assert answer(studio, f"/{TOKEN}/files", b"x", Origin=origin)[0] == 403


def test_faults_are_one_line(studio):
    def said(path, content):
        status, _, text = answer(studio, f"/{TOKEN}/{path}", content, X_Name="a%20b.bvh")
        assert status == 422
        assert "\n" not in json.loads(text)["error"]
        return json.loads(text)["error"]

    assert said("files", b"nonsense").startswith("a b.bvh:1: found 'nonsense'")
    assert "no JSON" in said("solve", b"{")
    assert "was not dropped here" in said("solve", json.dumps({"clip": "a", "character": "b"}).encode())
    assert "no JSON" in said("solve", b"[" * 100_000)


def odd_files():
    """A hundred files that are not whole: cut, with bytes exchanged, with another's name, nested, empty, and noise."""
    random = np.random.default_rng(5)
    whole = [path.read_bytes() for path in (WAVE, HERO, SAMPLES / "child.json")]
    names = ["a.bvh", "b.glb", "c.json", "d.fbx", "e.npz", "f.vrma", "../g.bvh", "h", "i\n.vrm", "j.gltf"]
    for name in names:
        for content in whole:
            at = int(random.integers(len(content)))
            yield name, content[:at]
            yield name, content[:at] + random.bytes(40) + content[at + 40 :]
            yield name, content
        yield name, random.choice([b"", b"[" * 100_000, b"PK\3\4", b"glTF" + bytes(100), random.bytes(1000)])


def test_a_hundred_odd_files_are_taken_or_refused_in_a_line_and_leave_nothing(studio, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    files = [*odd_files()]
    assert len(files) == 100
    for name, content in files:
        status, _, text = answer(studio, f"/{TOKEN}/files", content, X_Name=quote(name))
        said = json.loads(text)
        assert status in (200, 422)
        assert said["id"] if status == 200 else "\n" not in said["error"].replace("i\n.vrm", "")  # its own name
        assert "Traceback" not in text
    assert answer(studio, f"/{TOKEN}/files")[0] == 200
    assert not [*tmp_path.iterdir()]


def test_a_file_that_is_too_large_is_refused(studio, monkeypatch):
    from distretarget.studio import server

    monkeypatch.setattr(server, "LARGEST", 1000)
    status, _, text = answer(studio, f"/{TOKEN}/files", b"x" * 2000)
    assert (status, "larger" in json.loads(text)["error"]) == (422, True)


def test_samples_are_added_once_and_nothing_else_by_their_way(studio):
    abouts = [json.loads(answer(studio, f"/{TOKEN}/samples/hero.glb", b"")[2]) for _ in range(2)]
    assert abouts[0] == abouts[1]
    assert abouts[0]["character"]
    for name in ("nobody.bvh", "pyproject.toml", "..%2Fhero.glb"):
        assert answer(studio, f"/{TOKEN}/samples/{name}", b"")[0] in (404, 422)


def test_a_wheel_has_the_samples():
    wheel = tomllib.loads((SAMPLES.parent / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    paths = [f"{folder}/{name}" for name, folder in OFFERED.items()]
    assert {path: f"distretarget/{path}" for path in paths} == wheel["force-include"]


def test_what_cannot_be_written_is_not_offered(session):
    done = session.ordered()
    assert done.as_data["formats"] == ["glb", "bvh", "gltf", "vrma", "npz"]
    for form in ("vrm", "exe", "../x"):
        with pytest.raises(SettingsError, match="expected one of glb"):
            session.ordered(format=form)
        with pytest.raises(SettingsError):
            done.file(form)


def test_a_character_in_fbx_without_a_mesh_is_written_as_bvh(tmp_path):
    pytest.importorskip("ufbx")
    body = person()
    joints = zip(body.names, body.parents, body.offsets, strict=True)
    bones = [Node(name, int(parent), T=tuple(100.0 * offset)) for name, parent, offset in joints]
    (tmp_path / "bones.fbx").write_bytes(fbx(bones))
    done = Dropped(WAVE, tmp_path / "bones.fbx").ordered()
    assert done.as_data["formats"] == ["bvh", "vrma", "npz"]
    assert done.file("bvh")[1].startswith(b"HIERARCHY")


# ---- in a browser


@pytest.fixture
def expect():
    """What waits until something holds on a page, long enough for a busy machine."""
    expect = pytest.importorskip("playwright.sync_api").expect
    expect.set_options(timeout=PATIENCE)
    return expect


def drop_on(tab, path):
    """Drag a file from outside of the browser onto a page, and let it go there."""
    given = {"items": [], "files": [str(path)], "dragOperationsMask": 1}
    for kind in ("dragEnter", "dragOver", "drop"):
        tab.context.new_cdp_session(tab).send(
            "Input.dispatchDragEvent", {"type": kind, "x": 700, "y": 400, "data": given}
        )


def fill(tab, **fields):
    """Write into fields, and leave each, upon which its value counts."""
    for name, value in fields.items():
        tab.get_by_test_id(name).fill(value)
        tab.get_by_test_id(name).blur()


def test_from_an_empty_page_to_a_file_that_the_command_makes(studio, browser, tmp_path, expect):
    tab, problems = browser.new_page(viewport={"width": 1440, "height": 950}), []
    tab.on("pageerror", lambda error: problems.append(str(error)))
    tab.goto(studio)
    state, contacts = tab.get_by_test_id("solve-state"), tab.get_by_test_id("contact")
    expect(state).to_have_text("idle")

    def solved(words):
        expect(tab.get_by_test_id("command")).to_have_text(words)
        expect(state).to_have_text("done")

    for path in (SAMPLES / "wave.bvh", HERO):
        drop_on(tab, path)
        expect(tab.locator("body")).to_contain_text(path.name)
    plain = "distretarget wave.bvh hero.glb -o wave_hero.glb"
    solved(plain)
    assert tab.get_by_test_id("verdict").inner_text()
    count = contacts.count()
    first = contacts.first
    assert first.get_attribute("data-between")
    assert first.get_attribute("data-frames").count("-") == 1
    tab.get_by_test_id("drop-contact").first.click()
    solved(f"{plain} --contacts wave.contacts.json")
    assert contacts.count() == count
    tab.get_by_test_id("undo").click()
    solved(plain)
    tab.get_by_test_id("mirror").check()
    solved(f"{plain} --mirror")
    fill(tab, end="60f")
    solved(f"{plain} --end 60f --mirror")
    with tab.expect_download() as taken:
        tab.get_by_test_id("download").click()
    taken.value.save_as(tmp_path / "taken.glb")
    ran = CliRunner().invoke(
        cli,
        ["retarget", str(SAMPLES / "wave.bvh"), str(HERO), "-o", str(tmp_path / "x.glb"), "--end", "60f", "--mirror"],
    )
    assert ran.exit_code == 0
    assert (tmp_path / "taken.glb").read_bytes() == (tmp_path / "x.glb").read_bytes()
    for _ in range(2):
        tab.keyboard.press("Control+z")
    solved(plain)
    tab.set_input_files("[data-testid=clip]", {"name": "bad.bvh", "mimeType": "text/plain", "buffer": b"nonsense"})
    expect(tab.locator("#clip-what")).to_contain_text("bad.bvh")
    expect(tab.get_by_test_id("command")).to_have_text(plain)
    assert not problems
    tab.close()


def test_a_sample_is_one_press_away_from_an_empty_page(browser, expect):
    tab = browser.new_page()
    with serving(Session()) as address:
        tab.goto(address)
        tab.get_by_test_id("try-sample").click()
        expect(tab.get_by_test_id("command")).to_have_text(PLAIN)
        expect(tab.get_by_test_id("try-sample")).to_be_hidden()
        tab.get_by_role("button", name="walk").click()
        expect(tab.get_by_test_id("command")).to_have_text(PLAIN.replace("clap", "walk"))
        tab.close()


def test_each_clip_keeps_its_own_changes_and_all_are_taken_together(solved, tmp_path, expect):
    tab, wait = solved
    expect(tab.get_by_test_id("clips")).to_be_hidden()
    expect(tab.get_by_test_id("which")).to_be_hidden()
    fill(tab, end="60f")
    wait(" --end 60f")
    tab.get_by_role("button", name="walk").click()
    walk = tab.get_by_test_id("command")
    expect(walk).to_have_text(PLAIN.replace("clap", "walk"))
    tab.get_by_test_id("in-place").check()
    tab.get_by_test_id("clips").select_option("clap.bvh")
    wait(" --in-place --end 60f")
    commands = [f"distretarget {clip}.bvh hero.glb -o {{}} --in-place" for clip in ("clap", "walk")]
    commands[0] += " --end 60f"

    def take(which, command):
        tab.get_by_test_id("which").select_option(which)
        expect(tab.get_by_test_id("command")).to_have_text(command)
        with tab.expect_download(timeout=PATIENCE) as download:
            tab.get_by_test_id("download").click()
        return download.value

    merged = take("merged", " && ".join(commands).format("hero_clips.glb", "hero_clips.glb --add"))
    assert merged.suggested_filename == "hero_clips.glb"
    assert animations_in(load_file(merged.path())) == ("clap", "walk")
    zipped = take("each", " && ".join(commands).format("clap_hero.glb", "walk_hero.glb"))
    folder = tmp_path / "clips"
    with zipfile.ZipFile(zipped.path()) as archive:
        archive.extractall(folder)
    expected = {"clap": ["--end", "60f"], "walk": []}
    assert sorted(path.name for path in folder.iterdir()) == sorted(f"{clip}_hero.glb" for clip in expected)
    for clip, more in expected.items():
        output = tmp_path / f"{clip}_hero.glb"
        files = [str(SAMPLES / f"{clip}.bvh"), str(HERO), "-o", str(output)]
        assert CliRunner().invoke(cli, ["retarget", *files, "--in-place", *more]).exit_code == 0
        assert (folder / output.name).read_bytes() == output.read_bytes()


WHERE = """([view, joint, share]) => {
  const { stage } = app, side = stage.sides[view], views = stage.views.length, column = stage.overlaid ? 0 : view;
  const { positions, parents } = side.actors[0].motion, box = stage.canvas.getBoundingClientRect();
  const at = (number) => new THREE.Vector3().fromArray(positions, 3 * number), child = parents.indexOf(joint);
  const place = at(joint).lerp(at(child < 0 ? joint : child), share);
  place.add(side.group.position).project(stage.camera);
  return [box.left + ((place.x + 1) / 2 + column) * box.width / views, box.top + (1 - place.y) / 2 * box.height];
}"""


UNTIL = """async function until(holds, what) {
  for (let tries = 0; !holds(); tries++) {
    if (tries > 2400) throw new Error(`after 2 minutes not ${what()}`);
    await new Promise((go) => setTimeout(go, 50));
  }
}"""
DRAWN = f"""async () => {{ {UNTIL}
  await until(() => globalThis.app?.stage.sides.at(-1).actors[0].mesh.bent >= 0, () => "drawn");
}}"""


@pytest.fixture
def solved(browser, expect):
    """A tab with a clip on a character, of a studio of its own, and a function that waits for a solved command."""
    session, problems = Session(), []
    for path in (SAMPLES / "clap.bvh", HERO):
        session.add(path.name, path.read_bytes())

    def wait(words=""):
        expect(tab.get_by_test_id("command")).to_have_text(f"{PLAIN}{words}")
        expect(tab.get_by_test_id("solve-state")).to_have_text("done")

    with serving(session) as address:
        tab = browser.new_page(viewport={"width": 1440, "height": 1000})
        tab.on("pageerror", lambda error: problems.append(str(error)))
        tab.goto(address)
        wait()
        yield tab, wait
        assert not problems
        tab.close()


def drawn(tab):
    """The frame of the page with the player, once that shows the last result."""
    tab.frames[1].evaluate(DRAWN)
    return tab.frames[1]


DRAWS_AT_REST = """async () => {
  const { stage } = app, draw = stage.draw, second = () => new Promise((go) => setTimeout(go, 1000));
  let draws = 0;
  await second();
  stage.draw = (...given) => { draws++; draw.apply(stage, given); };
  await second();
  return draws;
}"""


def test_a_player_at_rest_does_not_draw(solved):
    """It would take time from what is solved next."""
    tab, _ = solved
    assert drawn(tab).evaluate(DRAWS_AT_REST) == 0


def taken(tab, press):
    """The content of what a press on something downloads."""
    with tab.expect_download() as download:
        press.click()
    return download.value.path().read_text()


def entries_of(tab):
    """The entries of the contact file that is taken away."""
    return json.loads(taken(tab, tab.locator("[data-take=contacts]")))["contacts"]


def drag(tab, contact, of_bar, shift):
    """Drag a bar from a place on it, a share of its width, by a share of the whole clip."""
    contact.scroll_into_view_if_needed()
    bar, track = contact.locator(".bar").bounding_box(), contact.locator(".track").bounding_box()
    x, y = bar["x"] + of_bar * bar["width"], bar["y"] + bar["height"] / 2
    tab.mouse.move(x, y)
    tab.mouse.down()
    tab.mouse.move(x + shift * track["width"], y, steps=4)
    tab.mouse.up()


def test_contacts_are_moved_stretched_and_kept_on_their_bars(solved, expect):
    tab, wait = solved
    first = tab.locator("[data-testid=contact][data-between='left hand,right hand'][data-frames='58-75']")
    drag(tab, first, 0.99, 20 / 277)
    wait(" --contacts clap.contacts.json")
    (entry,) = entries_of(tab)
    assert entry["between"] == ["left hand", "right hand"]
    assert entry["frames"][0] == 58
    assert 93 <= entry["frames"][1] <= 97
    made = tab.locator("[data-testid=contact][data-mark=added]")
    expect(made).to_have_count(1)
    expect(first).to_have_count(0)
    drag(tab, made, 0.5, -30 / 277)
    wait(" --contacts clap.contacts.json")
    expect(made).not_to_have_attribute("data-frames", f"58-{entry['frames'][1]}")
    (moved,) = entries_of(tab)
    assert np.ptp(moved["frames"]) == np.ptp(entry["frames"])
    assert 26 <= moved["frames"][0] <= 30
    tab.get_by_test_id("undo").click()
    tab.get_by_test_id("undo").click()
    wait()
    expect(first).to_have_count(1)
    drag(tab, first, 0.5, -50 / 277)
    wait(" --contacts clap.contacts.json")
    dropped, moved = entries_of(tab)
    assert (dropped["keep"], dropped["frames"]) == (False, [58, 75])
    assert moved["frames"][0] in range(6, 11)


def test_a_gap_a_firmness_a_plant_and_a_direction_are_set_and_go_through_a_file(solved, tmp_path):
    tab, wait = solved

    def fill(kind, one, frames, other="", **more):
        tab.get_by_test_id("kind").select_option(kind)
        for name, value in {"one": one, "frames": frames, **({"other": other} if other else {}), **more}.items():
            tab.get_by_test_id(name).fill(value)
        tab.get_by_test_id("make-contact").click()
        wait(" --contacts clap.contacts.json")

    fill("between", "left hand", "5-20", "right hand", gap="3", firmness="0.5")
    fill("plant", "left hand", "100-120")
    fill("look", "head", "0-30")
    whole = [
        {"between": ["left hand", "right hand"], "gap": 3, "firmness": 0.5, "frames": [5, 20]},
        {"plant": "left hand", "on": "where it is", "frames": [100, 120]},
        {"look": "head", "like": "source", "frames": [0, 30]},
    ]
    path = tmp_path / "mine.contacts.json"
    path.write_text(taken(tab, tab.locator("[data-take=contacts]")))
    assert json.loads(path.read_text())["contacts"] == whole
    for _ in range(3):
        tab.get_by_test_id("undo").click()
    wait()
    tab.set_input_files("[data-testid=open-contacts]", path)
    wait(" --contacts clap.contacts.json")
    assert entries_of(tab) == whole
    tab.locator("[data-testid=contact][data-frames='5-20'] .name").click()
    tab.get_by_test_id("gap").fill("1")
    tab.get_by_test_id("change-contact").click()
    tab.locator("[data-testid=solve-state]:text('done')").wait_for()
    assert {**whole[0], "gap": 1} in entries_of(tab)


def click_joint(tab, stage, view, joint, share=0.0):
    """Click a joint of the body in a view, or that far on the way to the next."""
    box = tab.locator("#player").bounding_box()
    while stage.evaluate("innerHeight") != round(box["height"]) - 2:  # its border; it hears of its size a little later
        tab.wait_for_timeout(20)
    settle(stage)
    x, y = stage.evaluate(WHERE, [view, joint, share])
    tab.mouse.click(box["x"] + x, box["y"] + y)


def test_two_clicks_on_bodies_pair_their_joints(solved, expect):
    tab, wait = solved
    stage, pairing = drawn(tab), tab.get_by_test_id("pairing")
    how = tab.locator("details", has_text="Objective")
    how.locator("summary").click()
    expect(how).to_have_attribute("open", "")
    tab.get_by_text("Joint mapping").click()
    expect(how).not_to_have_attribute("open", "")  # one panel at a time
    row = tab.locator("[data-driven=RightForeArm]")
    expect(row.locator("select")).to_have_value("RightElbow")
    click_joint(tab, stage, 2, load_target(HERO).skeleton.keys.index("Head"))  # nothing is to drive it yet
    click_joint(tab, stage, 0, read_motion(SAMPLES / "clap.bvh").skeleton.keys.index("LeftElbow"))
    expect(pairing).to_contain_text("LeftElbow drives ...")
    click_joint(tab, stage, 2, load_target(HERO).skeleton.keys.index("RightForeArm"))
    wait(" --map clap.map.json")
    expect(pairing).to_have_text("LeftElbow drives RightForeArm.")
    expect(row.locator("select")).to_have_value("LeftElbow")
    assert json.loads(taken(tab, tab.locator("[data-take=map]"))) == {"RightForeArm": "LeftElbow"}
    tab.get_by_test_id("undo").click()
    wait()
    row.locator("select").select_option("")
    wait(" --map clap.map.json")
    assert json.loads(taken(tab, tab.locator("[data-take=map]"))) == {"RightForeArm": None}
    tab.get_by_test_id("pairs").get_by_role("button", name="RightElbow", exact=True).click()  # it drives nothing now
    row.get_by_role("button").press("Enter")
    wait(" --map clap.map.json")
    assert json.loads(taken(tab, tab.locator("[data-take=map]"))) == {"RightForeArm": "RightElbow"}


def test_each_pair_has_a_colour_in_the_list_and_on_the_bodies_while_the_list_is_open(solved):
    tab, _ = solved
    stage, keys = drawn(tab), load_target(HERO).skeleton.keys
    shown = (
        "app.stage.sides.map((side) => side.dots.map((dot) => dot.visible && `#${dot.material.color.getHexString()}`))"
    )
    is_coloured = "app.stage.sides.some((side) => side.dots.some((dot) => dot.visible))"
    assert not stage.evaluate(is_coloured)
    tab.locator("#who > summary").click()
    wait_until_true(stage, is_coloured)
    source, copy, result = stage.evaluate(shown)
    assert copy == result
    names = read_motion(SAMPLES / "clap.bvh").skeleton.keys
    assert source[names.index("LeftElbow")] == result[keys.index("LeftForeArm")] != result[keys.index("RightForeArm")]
    grey = {key for key, tone in zip(keys, result, strict=True) if tone == "#888888"}
    nothing = tab.locator("[data-driven]").filter(has=tab.locator("select", has_text="nothing"))
    assert grey == {
        each.get_attribute("data-driven") for each in nothing.all() if not each.locator("select").input_value()
    }
    tab.locator("#who > summary").click()
    wait_until_true(stage, f"!{is_coloured}")


def test_a_rest_pose_is_given_and_taken_back(solved, expect):
    tab, wait = solved
    tab.locator("#who > summary").click()
    tab.set_input_files("[data-testid=rest]", SAMPLES / "walk.bvh")
    wait(" --map clap.map.json")
    assert json.loads(taken(tab, tab.locator("[data-take=map]")))["rest"].keys() >= {"Hips", "RightWrist"}
    tab.get_by_test_id("no-rest").click()
    wait()
    expect(tab.get_by_test_id("no-rest")).to_be_hidden()
    tab.set_input_files("[data-testid=rest]", {"name": "bad.bvh", "mimeType": "text/plain", "buffer": b"nonsense"})
    expect(tab.locator("#trouble")).to_contain_text("bad.bvh")


def test_two_clicks_on_the_body_make_a_contact_of_the_parts_there(solved, expect):
    tab, wait = solved
    keys = load_target(HERO).skeleton.keys
    stage = drawn(tab)
    tab.get_by_test_id("gap").fill("3")
    for frame, parts, count in ((0, ("LeftForeArm", "Head"), 1), (255, ("RightHand", "Spine1"), 2)):
        stage.evaluate("(frame) => goTo(frame)", frame)
        settle(stage)
        tab.get_by_test_id("pick").click()
        for part in parts:
            click_joint(tab, stage, 2, keys.index(part), 0.5)
        expect(tab.locator("[data-testid=contact][data-mark=added]")).to_have_count(count)
    wait(" --contacts clap.contacts.json")
    left, right = entries_of(tab)
    for entry, clicked in ((left, 0.5), (right, 0.65)):  # the middles of the head and of Spine1
        (_, _), (along, _) = entry.pop("anchors")
        assert along == pytest.approx(clicked, abs=0.1)
    assert left == {"between": ["left forearm", "head"], "gap": 3, "frames": [0, 15]}
    assert right == {"between": ["right hand", "trunk"], "gap": 3, "frames": [240, 270]}
    tab.locator("[data-mark=added] .name").first.click()
    assert re.fullmatch(r"left forearm at -?\d\.\d+, -?\d+", tab.get_by_test_id("one").input_value())
    assert "right hand - trunk" not in tab.get_by_test_id("verdict").inner_text()


@pytest.mark.parametrize("overlaid", [False, True])
def test_a_click_means_the_part_whose_skin_is_there(solved, overlaid):
    tab, _ = solved
    stage, keys = drawn(tab), load_target(HERO).skeleton.keys
    if overlaid:
        stage.press("#player", "o")
        settle(stage)
    for part in ("LeftUpLeg", "LeftLeg", "RightArm", "RightForeArm", "Head"):
        place = stage.evaluate(WHERE, [2, keys.index(part), 0.5])
        found = stage.evaluate(
            "([x, y]) => { const { left, top } = $('player').getBoundingClientRect(); "
            "return app.stage.jointAt(x - left, y - top); }",
            place,
        )
        assert keys[found["skin"]] == part
    assert stage.evaluate("app.stage.jointAt(2, 2)") == {
        "role": "result" if overlaid else "source",
        "joint": -1,
        "skin": -1,
        "at": None,
    }


def test_a_project_is_saved_and_opened_again(solved, tmp_path, expect):
    tab, wait = solved
    tab.get_by_test_id("mirror").check()
    fill(tab, end="60f")
    wait(" --end 60f --mirror")
    path = tmp_path / "mine.json"
    path.write_text(taken(tab, tab.get_by_test_id("save-project")))
    for _ in range(2):
        tab.get_by_test_id("undo").click()
    wait()
    tab.set_input_files("[data-testid=open-project]", path)
    wait(" --end 60f --mirror")
    tab.get_by_role("button", name="walk").click()
    expect(tab.get_by_test_id("command")).to_have_text(PLAIN.replace("clap", "walk"), timeout=30_000)
    fill(tab, start="2")
    expect(tab.get_by_test_id("command")).to_contain_text("--start 2", timeout=30_000)
    path.write_text(taken(tab, tab.get_by_test_id("save-project")))
    clip = json.loads(path.read_text())["other_clips"][0]
    assert (clip["name"], clip["edits"]) == ("clap.bvh", {"end": "60f", "mirror": True})
    tab.on("dialog", lambda dialog: dialog.accept())
    tab.reload()  # the files stay, edits do not
    tab.set_input_files("[data-testid=open-project]", path)
    expect(tab.get_by_test_id("command")).to_have_text(f"{PLAIN.replace('clap', 'walk')} --start 2", timeout=30_000)
    tab.get_by_test_id("clips").select_option("clap.bvh")
    wait(" --end 60f --mirror")
    path.write_text(path.read_text().replace("sha256:", "sha256:0"))
    tab.set_input_files("[data-testid=open-project]", path)
    expect(tab.get_by_role("alert")).to_contain_text("the walk.bvh that was dropped is not the one of the project")


SHOWN = f"""async ([count]) => {{ {UNTIL}
  const shown = () => globalThis.app?.clock.count;
  await until(() => shown() === count, () => `${{count}} frames, but ${{shown()}}`);
  const [{{ motion }}] = app.stage.sides.at(-1).actors;
  const pose = (frame) => {{ motion.place(frame); return Array.from(motion.positions); }};
  return [pose(0), pose(count - 1)];
}}"""


def ends(tab, count):
    """The joints of the result in the first and the last frame of the picture, once that has so many frames."""
    return (np.reshape(pose, (-1, 3)) for pose in tab.frames[1].evaluate(SHOWN, [count]))


def test_a_clip_is_cut_and_sampled_as_the_fields_say(solved):
    tab, wait = solved
    drawn(tab)
    whole, _ = ends(tab, 277)

    fill(tab, fps="30")
    wait(" --fps 30")
    first, _ = ends(tab, 139)  # 276 / 60 s
    assert first == pytest.approx(whole, abs=0.002)
    fill(tab, fps="", start="1", end="90f")
    wait(" --start 1 --end 90f")
    ends(tab, 31)  # frames 60 to 90
    fill(tab, start="90f", end="1")
    tab.get_by_role("alert").wait_for()
    assert tab.get_by_test_id("solve-state").inner_text() == "idle"
    fill(tab, start="", end="")
    wait()
    assert tab.get_by_role("alert").is_hidden()


def test_a_loop_ends_where_it_begins(solved):
    tab, wait = solved
    drawn(tab)
    fill(tab, start="0", end="90f")
    wait(" --start 0 --end 90f")
    first, last = ends(tab, 91)
    apart = np.linalg.norm(last - first, axis=1).max()
    tab.get_by_test_id("loop").check()
    wait(" --start 0 --end 90f --loop")
    for _ in range(100):  # the picture comes after the command
        first, last = ends(tab, 91)
        if np.linalg.norm(last - first, axis=1).max() < 0.1 * apart:
            return
        tab.wait_for_timeout(100)
    pytest.fail("the seam is as far apart as without the loop")


def test_ten_changes_are_undone_and_done_again(solved):
    tab, wait = solved
    for turn in range(1, 11):
        fill(tab, turn=str(turn))
    wait(" --turn 10")
    for _ in range(10):
        tab.get_by_test_id("undo").click()
    wait()
    for _ in range(10):
        tab.keyboard.press("Control+Shift+Z")
    wait(" --turn 10")


def test_the_player_may_load_before_the_scripts_of_the_page(browser):
    """Then the page still hears that the player is ready."""
    with serving(Dropped()) as address:
        tab = browser.new_page()
        tab.route("**/contacts.js", lambda route: (time.sleep(2), route.continue_()))
        tab.goto(address)
        drawn(tab)
        tab.close()


def test_a_picture_of_the_view_is_saved(solved):
    stage = drawn(solved[0])
    with solved[0].expect_download() as download:
        stage.locator("#picture").click()
    assert download.value.suggested_filename == "frame_0.png"
    assert download.value.path().read_bytes().startswith(b"\x89PNG")


def test_files_that_do_not_fit_together_are_refused(monkeypatch):
    from distretarget.studio import session

    content = WAVE.read_bytes()
    monkeypatch.setattr(session, "MOST", 2 * len(content))
    full = Session()
    for name in ("wave.bvh", "wave.bvh", "other.bvh"):
        full.add(name, content)  # the same file again takes no place
    with pytest.raises(FileError, match="does not fit"):
        full.add("more.bvh", content)
    assert len(full.dropped) == 2


NEAR = """(joint) => {
  const { stage } = app, { group, actors: [{ motion }] } = stage.sides.at(-1), { target } = stage.controls;
  const place = new THREE.Vector3().fromArray(motion.positions, 3 * joint).add(group.position);
  return [place.distanceTo(target), stage.camera.position.distanceTo(target)];
}"""


def test_a_remark_leads_to_its_frame_and_its_part(solved, expect):
    tab, _ = solved
    stage, keys = drawn(tab), load_target(HERO).skeleton.keys
    link = tab.get_by_test_id("verdict").get_by_role("link").last
    joint, frame = re.search(r"direction error: (\w+), .* at frame (\d+)", link.inner_text()).groups()
    assert int(frame) > 0
    _, away = stage.evaluate(NEAR, keys.index(joint))
    link.focus()
    tab.keyboard.press("Enter")
    expect(tab.frame_locator("#player").locator("#now")).to_contain_text(f"{frame} / 276")
    settle(stage)
    ((driver, marked),) = stage.evaluate("app.marks.pairs")
    assert marked == keys.index(joint)
    assert read_motion(SAMPLES / "clap.bvh").skeleton.keys[driver].endswith(joint.replace("ForeArm", "Elbow"))
    off, near = stage.evaluate(NEAR, keys.index(joint))
    assert off < 1e-3
    assert near < away / 2


def test_a_remark_on_parts_that_do_not_meet_leads_to_both(session):
    entry = {"between": ["left hand", "right foot"], "gap": 0, "frames": [40, 60]}
    (remark,) = (
        each for each in session.ordered(contacts=[entry]).as_data["warnings"] if "is missed by" in each["text"]
    )
    assert remark["frame"] in range(40, 61)
    assert remark["joints"] == ["LeftHand", "RightFoot"]


SEEN = """[app.clock.frame, app.clock.loop, app.stage.camera.position.toArray(), app.stage.controls.target.toArray(),
  app.stage.sides.map(({ shown }) => shown), app.stage.overlaid, app.marks.trails, app.marks.pairs]"""
BODY = "app.stage.actors[2].mesh.geometry.attributes.position.count"


def test_frame_view_and_selection_stay_while_contacts_and_bodies_change(solved, expect):
    tab, wait = solved
    stage = drawn(tab)
    tab.get_by_text("Joint mapping").click()
    click_joint(tab, stage, 0, read_motion(SAMPLES / "clap.bvh").skeleton.keys.index("LeftElbow"))
    for key in ("l", "End", "l", "ArrowLeft", "t", "o", "Shift+d", "d", "+"):
        stage.press("#player", key)
    stage.get_by_role("button", name="Copied rotations").click()
    settle(stage)
    seen, corners = stage.evaluate(SEEN), stage.evaluate(BODY)
    assert (seen[0], seen[1], seen[4:7]) == (275, [0, 276], [[True, False, True], True, True])
    assert seen[-1][0][0] > 0
    tab.get_by_test_id("drop-contact").last.click()
    wait(" --contacts clap.contacts.json")
    expect(tab.frame_locator("#player").locator("#entry")).to_contain_text("dropped: ")
    assert (stage.evaluate(SEEN), stage.evaluate(BODY)) == (seen, corners)
    tab.set_input_files("[data-testid=character]", SAMPLES / "child.json")
    expect(tab.get_by_test_id("command")).to_contain_text("clap_child.bvh")
    wait_until_true(stage, f"{BODY} !== {corners}")
    other = stage.evaluate(SEEN)
    assert other[:2] + other[4:7] == seen[:2] + seen[4:7]
    apart = [np.linalg.norm(np.subtract(*each[2:4])) for each in (seen, other)]
    assert apart[0] == pytest.approx(apart[1])


def test_a_second_tab_has_the_files_and_orders_of_its_own(solved, browser, expect):
    tab, wait = solved
    other = browser.new_page()
    other.goto(tab.url)
    other.get_by_test_id("mirror").check()
    expect(other.get_by_test_id("command")).to_contain_text("--mirror")
    wait()
    fill(tab, turn="90")
    wait(" --turn 90")
    expect(other.get_by_test_id("command")).to_contain_text("--mirror")
    assert "--turn" not in other.get_by_test_id("command").inner_text()
    other.close()


@pytest.mark.skipif(os.name == "nt", reason="signals as on POSIX")
def test_nothing_is_left_in_the_temporary_folder_when_it_is_killed_while_it_solves(tmp_path):
    pytest.importorskip("uvicorn")
    command = [sys.executable, "-m", "distretarget", "studio", str(SAMPLES / "walk.bvh"), str(HERO), "--no-browser"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env={**os.environ, "TMPDIR": str(tmp_path)}
    ) as ran:
        address = ran.stdout.readline().strip()
        path = urlsplit(address).path
        dropped = json.loads(answer(address, f"{path}files")[2])
        order = {"clip": dropped[0]["id"], "character": dropped[1]["id"]}
        solving = socket.create_connection(("127.0.0.1", urlsplit(address).port))
        body = json.dumps(order).encode()
        head = f"POST {path}solve HTTP/1.1\r\nHost: {urlsplit(address).netloc}\r\nContent-Length: {len(body)}\r\n\r\n"
        solving.sendall(head.encode() + body)
        time.sleep(0.2)
        ran.kill()
    solving.close()
    assert not [*tmp_path.iterdir()]
