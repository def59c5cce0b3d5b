"""`distretarget studio`: retarget on a local page."""

from __future__ import annotations

import ctypes
import importlib.util
import secrets
import socket
import sys
import webbrowser
from pathlib import Path
from types import FrameType

import click

from distretarget.cli.options import PATH, quiet
from distretarget.cli.outputs import say
from distretarget.errors import FileError, MissingPackageError
from distretarget.io.files import read_bytes

NEEDED = ("starlette", "uvicorn")
HOST = "127.0.0.1"
M_ARENA_MAX, ARENAS = -8, 2  # glibc's key of the setting, and the number of heaps that threads share


@click.command("studio")
@click.argument("files", nargs=-1, type=PATH)
@click.option("--port", type=click.IntRange(0, 65535), default=0, metavar="N", help="The port. Default: a free one.")
@click.option("--no-browser", is_flag=True, help="Open no browser; the address is printed.")
@quiet
def studio_command(files: tuple[Path, ...], port: int, no_browser: bool) -> None:
    """Retarget on a page in the browser.

    Drop clips and a character on the page, see and change the result, and download it. FILES are loaded at the start.
    Only this machine can open the page, at a secret address. Dropped files are not stored on disk. Ctrl+C ends it.

    \b
    distretarget studio
    distretarget studio walk.bvh hero.glb
    """  # noqa: D301
    if any(importlib.util.find_spec(name) is None for name in NEEDED):
        raise MissingPackageError("the studio needs starlette and uvicorn; pip install 'distretarget[studio]'")
    _share_heaps()
    import uvicorn

    from distretarget.studio.server import studio_app
    from distretarget.studio.session import Session

    session, dropped = Session(), []
    for path in files:
        dropped.append(str(session.add(path.name, read_bytes(path))["id"]))
    try:
        listening = socket.create_server((HOST, port))
    except OSError as error:
        raise FileError(f"port {port}", f"cannot be used: {error.strerror}; give another, or --port 0") from None
    port, token = listening.getsockname()[1], secrets.token_urlsafe(24)
    address = f"http://{HOST}:{port}/{token}/"
    say(address)

    class Server(uvicorn.Server):
        def handle_exit(self, sig: int, frame: FrameType | None) -> None:
            session.end()
            super().handle_exit(sig, frame)

    app = studio_app(token, port, session)
    server = Server(
        uvicorn.Config(app, log_level="warning", access_log=False, server_header=False, timeout_graceful_shutdown=1)
    )
    if not no_browser:
        webbrowser.open(address)
    server.run(sockets=[listening])


def _share_heaps() -> None:
    """Let threads share heaps if the C library is glibc; with a heap per thread, freed memory would stay in each."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt:
        mallopt(M_ARENA_MAX, ARENAS)
