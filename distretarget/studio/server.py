"""The server of the studio, which answers only this machine, and only the page that knows its token."""

from __future__ import annotations

import json
import secrets
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from typing import Any
from urllib.parse import unquote

import anyio.to_thread
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route

from distretarget.errors import DistretargetError, FileError, SettingsError
from distretarget.io.input_file import InputFile
from distretarget.io.map_json import rest_pose_in
from distretarget.report.actors import without_known
from distretarget.report.page import asset, html_page
from distretarget.studio.order import Order
from distretarget.studio.session import FinishedOrder, Session, SupersededError

SAMPLES = {  # their folders, beside the package in the repository, inside it in a wheel (pyproject.toml)
    "clap.bvh": "sample_bvh",
    "walk.bvh": "sample_bvh",
    "hands_on_hips.bvh": "sample_bvh",
    "hero.glb": "sample_characters",
}
LARGEST = 1_000_000_000  # of a dropped file [bytes]
LONGEST_TAB = 40  # of the id of a tab
LARGEST_ORDER = 10_000_000  # [bytes]
ASSETS = {"studio.css": "text/css", "studio.js": "text/javascript", "contacts.js": "text/javascript"}
# Downloads of several results: whether merged into one file, and whether with their inputs.
BUNDLES = {"each": (False, False), "merged": (True, False), "zip": (False, True), "merged-zip": (True, True)}
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
    "frame-src 'self'; form-action 'none'; base-uri 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}

Answer = Callable[[Request], Awaitable[Response]]


def sample(name: str) -> bytes:
    """Return the content of a sample; a FileError if there is none of that name."""
    package = files("distretarget")
    for folder in (package, package / ".."):
        file = folder / SAMPLES.get(name, "") / name
        if name in SAMPLES and file.is_file():
            return file.read_bytes()
    raise FileError(name, f"is no sample; there are {', '.join(SAMPLES)}")


def studio_app(token: str, port: int, session: Session | None = None) -> Starlette:
    """Return the application that answers requests to /TOKEN/ on a port of this machine, and no others."""
    hosts = frozenset(f"{name}:{port}" for name in ("127.0.0.1", "localhost"))
    studio = _Studio(token, hosts, session or Session())
    routes = [
        ("", studio.page, "GET"),
        ("assets/{name}", studio.asset, "GET"),
        ("files", studio.drop, "POST"),
        ("files", studio.dropped, "GET"),
        ("samples/{name}", studio.try_sample, "POST"),
        ("rest", studio.rest_pose, "POST"),
        ("solve", studio.solve, "POST"),
        ("judge", studio.judge, "POST"),
        ("player", studio.player, "GET"),
        ("take/{kind}", studio.take, "POST"),
        ("command/{kind}", studio.command, "POST"),
    ]
    return Starlette(
        routes=[Route(f"/{{token}}/{path}", studio.guarded(answer), methods=[how]) for path, answer, how in routes]
    )


@dataclass(frozen=True)
class _Studio:
    """The answers to the requests of the page."""

    token: str
    hosts: frozenset[str]  # accepted Host headers: names of this machine, with the port
    session: Session

    def guarded(self, answer: Answer) -> Answer:
        """Return an answer that refuses requests that are not from the page, with errors as JSON."""

        async def answered(request: Request) -> Response:
            origin = request.headers.get("origin")
            has_token = secrets.compare_digest(request.path_params["token"].encode(), self.token.encode())
            if not has_token or request.headers.get("host") not in self.hosts:
                return _refused(404)
            if origin is not None and origin.removeprefix("http://") not in self.hosts:
                return _refused(403)
            try:
                response = await answer(request)
            except SupersededError:
                response = JSONResponse({"superseded": True}, 409)
            except DistretargetError as error:
                response = JSONResponse({"error": str(error)}, 422)
            response.headers.update(HEADERS)
            return response

        return answered

    async def page(self, _request: Request) -> Response:
        return HTMLResponse(asset("studio.html", __package__), headers={"Content-Security-Policy": POLICY})

    async def asset(self, request: Request) -> Response:
        name = request.path_params["name"]
        return Response(asset(name, __package__), media_type=ASSETS[name]) if name in ASSETS else _refused(404)

    async def drop(self, request: Request) -> Response:
        content = await _body(request, LARGEST)
        return JSONResponse(await anyio.to_thread.run_sync(self.session.add, _name(request), content))

    async def try_sample(self, request: Request) -> Response:
        name = request.path_params["name"]
        return JSONResponse(await anyio.to_thread.run_sync(lambda: self.session.add(name, sample(name))))

    async def rest_pose(self, request: Request) -> Response:
        file = InputFile(await _body(request, LARGEST), _name(request), has_folder=False)
        return JSONResponse(dict((await anyio.to_thread.run_sync(rest_pose_in, file)).rotations))

    async def solve(self, request: Request) -> Response:
        finished = await self._finished(request)
        known = request.headers.get("x-has", "").split(",")
        return await anyio.to_thread.run_sync(lambda: JSONResponse(without_known(finished.motions, known)))

    async def judge(self, request: Request) -> Response:
        finished = await self._finished(request)
        return await anyio.to_thread.run_sync(lambda: JSONResponse(finished.as_data))

    async def dropped(self, _request: Request) -> Response:
        return JSONResponse(self.session.dropped)

    async def player(self, _request: Request) -> Response:
        return HTMLResponse(html_page("framed", "The player", {}))

    async def take(self, request: Request) -> Response:
        kind = request.path_params["kind"]
        if kind in BUNDLES:
            bundle = partial(self.session.bundle, await _orders(request), *BUNDLES[kind], tab=_tab(request))
            name, content = await anyio.to_thread.run_sync(bundle)
        elif kind == "project":
            name, content = self.session.project(await _orders(request))
        else:
            finished = await self._finished(request)
            name, content = await anyio.to_thread.run_sync(finished.file, kind)
        return Response(content, media_type="application/octet-stream", headers={"X-Name": json.dumps(name)[1:-1]})

    async def command(self, request: Request) -> Response:
        merged, _ = BUNDLES.get(request.path_params["kind"], (False, False))
        return PlainTextResponse(self.session.command(await _orders(request), merged))

    async def _finished(self, request: Request) -> FinishedOrder:
        order = Order.of(await _json(request))
        return await anyio.to_thread.run_sync(self.session.carry_out, order, _tab(request))


async def _body(request: Request, largest: int) -> bytes:
    """The content of a request; a SettingsError if it is too large."""
    length, content = request.headers.get("content-length", "0"), bytearray()
    too_large = length.isdecimal() and int(length) > largest
    async for chunk in request.stream():  # to its end: browsers do not read the answer before
        too_large = too_large or len(content) + len(chunk) > largest
        if too_large:
            content.clear()
        else:
            content += chunk
    if too_large:
        raise SettingsError(f"it is larger than {largest:,} bytes; use the command line")
    return bytes(content)


def _name(request: Request) -> str:
    """The name of a dropped file."""
    return unquote(request.headers.get("x-name", "file"))


def _tab(request: Request) -> str:
    """The id of the browser's tab."""
    return request.headers.get("x-tab", "")[:LONGEST_TAB]


async def _orders(request: Request) -> list[Order]:
    """The orders in a request, which has one or a list."""
    given = await _json(request)
    return [Order.of(each) for each in (given if isinstance(given, list) else [given])]


async def _json(request: Request) -> Any:
    """The JSON of a request."""
    try:
        return json.loads(await _body(request, LARGEST_ORDER))
    except (ValueError, RecursionError):
        raise SettingsError("an order is no JSON") from None


def _refused(status: int) -> Response:
    return PlainTextResponse("", status)
