"""Reading files names their faults; writing writes a file completely or not at all."""

import errno
import os
import socket
import stat

import pytest

from distretarget.batch.plan import DATABASE
from distretarget.batch.results import Database
from distretarget.errors import FileError
from distretarget.io.files import (
    check_inside,
    check_writable,
    hash_of_file,
    make_folder,
    read_text,
    safe_file_name,
    write_whole,
)


def read(tmp_path, content):
    path = tmp_path / "a.bvh"
    path.write_bytes(content)
    return read_text(path)


def names(folder):
    return [path.name for path in folder.iterdir()]


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"a\r\nb\rc\n", "a\r\nb\rc\n"),
        (b"\xef\xbb\xbfa", "a"),
        ("腰".encode(), "腰"),
        ("腰".encode("utf-16"), "腰"),
        (b"\xfe\xff\x00a", "a"),
        (b"a\n\x1a", "a\n"),
    ],
    ids=["line ends", "mark", "utf-8", "utf-16", "utf-16 big-endian", "Ctrl-Z"],
)
def test_reading(tmp_path, content, text):
    assert read(tmp_path, content) == text


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "is empty"),
        (b"\xef\xbb\xbf \n", "is empty"),
        (b"ab\0c", "is not a text file: character 3 is NUL"),
        (b"\xff\xfe\x00\xd8\x41\x00", "begins with a UTF-16 mark, but is not valid UTF-16: illegal UTF-16 surrogate"),
        ("a".encode("utf-32"), "is not a text file: character 1 is NUL"),
    ],
)
def test_what_is_no_text_is_refused(tmp_path, content, reason):
    with pytest.raises(FileError) as caught:
        read(tmp_path, content)
    assert caught.value.path == tmp_path / "a.bvh"
    assert caught.value.reason == reason


def test_reading_what_is_not_there(tmp_path):
    with pytest.raises(FileError, match="there is no such file"):
        read_text(tmp_path / "none.bvh")
    with pytest.raises(FileError, match="is a folder"):
        read_text(tmp_path)
    with pytest.raises(FileError, match="is not a valid file name"):
        read_text("a\0b")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_only_regular_files_are_read(tmp_path, monkeypatch):
    """A pipe would be waited for, and some devices have no end."""
    monkeypatch.chdir(tmp_path)  # names of sockets are short
    os.mkfifo("pipe")
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind("socket")
        for path in ("pipe", "socket", "/dev/zero"):
            with pytest.raises(FileError, match="is not a regular file"):
                read_text(path)
    assert hash_of_file(tmp_path / "pipe") is None
    (tmp_path / DATABASE).symlink_to(tmp_path / "pipe")
    with pytest.raises(FileError, match="is not a regular file"):
        Database(tmp_path)


@pytest.mark.parametrize(
    ("name", "safe"),
    [
        ("walk 1.b", "walk 1.b"),
        ("C:x", "C_x"),
        ("a/b\\c", "a_b_c"),
        ("Con", "_Con"),
        ("aux.b", "_aux.b"),
        ("lpt1 .b", "_lpt1 .b"),
        ("com10", "com10"),
        ("x. ", "x"),
        ("..", ""),
        ("\x1b\u202ea", "__a"),
    ],
)
def test_names_of_results_are_names_of_files_on_every_system(name, safe):
    assert safe_file_name(name) == safe


def test_a_file_has_the_bytes_that_are_given_and_the_usual_permissions(tmp_path):
    (tmp_path / "usual").write_text("x")
    write_whole(tmp_path / "a", "x")
    assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == stat.S_IMODE((tmp_path / "usual").stat().st_mode)
    write_whole(tmp_path / "ends", "x\ny\r\n")
    assert (tmp_path / "ends").read_bytes() == b"x\ny\r\n"
    content = bytes(range(1, 256)) + b"\n"
    write_whole(tmp_path / "b", read(tmp_path, content))
    assert (tmp_path / "b").read_bytes() == content


def test_a_file_is_replaced_only_when_asked(tmp_path):
    path = tmp_path / "a"
    path.write_text("old")
    for write in (lambda: write_whole(path, "new"), lambda: check_writable(path)):
        with pytest.raises(FileError, match="exists already; --overwrite"):
            write()
        assert path.read_text() == "old"
    check_writable(path, overwrite=True)
    write_whole(path, "new", overwrite=True)
    assert path.read_text() == "new"


@pytest.mark.skipif(not hasattr(os, "chown"), reason="needs permissions as Unix has them")
def test_a_replaced_file_keeps_its_permissions_and_owner(tmp_path, monkeypatch):
    path, owners = tmp_path / "a", []
    monkeypatch.setattr(os, "chown", lambda _path, user, group: owners.append((user, group)))
    for mode in (0o600, 0o644, 0o755):
        path.write_text("old")
        path.chmod(mode)
        write_whole(path, "new", overwrite=True)
        assert stat.S_IMODE(path.stat().st_mode) == mode
    assert set(owners) == {(path.stat().st_uid, path.stat().st_gid)}


def test_a_link_is_followed(tmp_path):
    (tmp_path / "target").write_text("old")
    (tmp_path / "link").symlink_to("target")
    write_whole(tmp_path / "link", "new", overwrite=True)
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_text() == "new"


def test_a_link_to_nothing_is_not_written_through(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    for overwrite in (False, True):
        with pytest.raises(FileError, match=r"is a link to '.*elsewhere', which does not exist"):
            write_whole(tmp_path / "link", "new", overwrite)
    assert names(tmp_path) == ["link"]


def test_a_place_in_a_folder_is_in_that_folder(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "link").symlink_to(tmp_path)
    check_inside(tmp_path / "out" / "new" / "a", tmp_path / "out")
    for outside in ("link/a", "../a"):
        with pytest.raises(FileError, match="leads out of the folder"):
            check_inside(tmp_path / "out" / outside, tmp_path / "out")


def test_places_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("x")
    places = {
        "is a folder": tmp_path,
        "there is no folder": tmp_path / "none" / "a",
        "is not a valid file name": "a\0b",
        "file": tmp_path / "file" / "a",
        "is not a regular file": os.devnull,
    }
    for reason, place in places.items():
        for write in (
            lambda place=place: write_whole(place, "x", True),
            lambda place=place: check_writable(place, True),
        ):
            with pytest.raises(FileError, match=reason):
                write()
    assert names(tmp_path) == ["file"]


def test_places_without_permission(tmp_path, monkeypatch):
    (tmp_path / "a").write_text("old")
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(FileError, match="permission denied to write into the folder"):
        check_writable(tmp_path / "b")
    with pytest.raises(FileError, match="write-protected"):
        write_whole(tmp_path / "a", "new", overwrite=True)


@pytest.mark.parametrize("step", ["fsync", "replace"])
@pytest.mark.parametrize(
    ("number", "reason"),
    [
        (errno.ENOSPC, "the disk is full"),
        (errno.EDQUOT, "the disk quota is used up"),
        (errno.EFBIG, "is larger than files may be here; raise the limit"),
        (errno.EACCES, "permission denied"),
        (errno.EIO, os.strerror(errno.EIO)),
    ],
)
def test_a_failure_changes_nothing(tmp_path, monkeypatch, step, number, reason):
    def fail(*_):
        raise OSError(number, os.strerror(number))

    path = tmp_path / "a"
    path.write_text("old")
    monkeypatch.setattr(os, step, fail)
    with pytest.raises(FileError, match=reason):
        write_whole(path, "new", overwrite=True)
    assert names(tmp_path) == ["a"]
    assert path.read_text() == "old"


def test_an_interruption_leaves_no_temporary_file(tmp_path, monkeypatch):
    def interrupt(_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_whole(tmp_path / "a", "new")
    assert names(tmp_path) == []


def test_a_character_no_file_can_hold(tmp_path):
    with pytest.raises(FileError, match="ud800"):
        write_whole(tmp_path / "a", "x\ud800")
    assert names(tmp_path) == []


def test_the_file_is_complete_before_it_has_its_name(tmp_path, monkeypatch):
    seen = []
    monkeypatch.setattr(os, "fsync", lambda _: seen.append((tmp_path / "a").exists()))
    write_whole(tmp_path / "a", "x" * 100_000)
    assert seen == [False]
    assert (tmp_path / "a").read_text() == "x" * 100_000


def test_a_folder_is_made_with_those_that_it_is_in(tmp_path):
    for _ in range(2):
        make_folder(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
    (tmp_path / "file").touch()
    for place in ("file", "file/in"):
        with pytest.raises(FileError, match=f"{place}: is a file or inside one, expected a folder"):
            make_folder(tmp_path / place)
    with pytest.raises(FileError, match="the folder cannot be made"):
        make_folder(tmp_path / ("a" * 1000))
