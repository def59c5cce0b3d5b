"""The server of the studio: for this machine alone, and for the one page that knows its token."""

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
from distretarget.studio.bench import Bench, Done, OvertakenError
from distretarget.studio.order import Order

SAMPLES = {  # with their folders, in the repository, and in the package of a wheel, as pyproject.toml says
    "clap.bvh": "sample_bvh",
    "walk.bvh": "sample_bvh",
    "hands_on_hips.bvh": "sample_bvh",
    "hero.glb": "sample_characters",
}
LARGEST = 1_000_000_000  # of a file that is dropped [bytes]
LONGEST_TAB = 40  # of what a tab calls itself
LARGEST_ORDER = 10_000_000  # [bytes]
ASSETS = {"studio.css": "text/css", "studio.js": "text/javascript", "contacts.js": "text/javascript"}
# how results are taken together, by the kind of file: whether in one result, and whether with their files
TOGETHER = {"each": (False, False), "merged": (True, False), "zip": (False, True), "merged-zip": (True, True)}
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


def studio_app(token: str, port: int, bench: Bench | None = None) -> Starlette:
    """Return the application that answers at /TOKEN/ on a port of this machine, and nothing else."""
    hosts = frozenset(f"{name}:{port}" for name in ("127.0.0.1", "localhost"))
    studio = _Studio(token, hosts, bench or Bench())
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
    """What answers the requests of the page that knows the token."""

    token: str
    hosts: frozenset[str]  # the names of this machine, with the port
    bench: Bench

    def guarded(self, answer: Answer) -> Answer:
        """An answer for the page alone, with errors as JSON."""

        async def answered(request: Request) -> Response:
            origin = request.headers.get("origin")
            right = secrets.compare_digest(request.path_params["token"].encode(), self.token.encode())
            if not right or request.headers.get("host") not in self.hosts:
                return _refused(404)
            if origin is not None and origin.removeprefix("http://") not in self.hosts:
                return _refused(403)
            try:
                response = await answer(request)
            except OvertakenError:
                response = JSONResponse({"overtaken": True}, 409)
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
        return JSONResponse(await anyio.to_thread.run_sync(self.bench.add, _name(request), content))

    async def try_sample(self, request: Request) -> Response:
        name = request.path_params["name"]
        return JSONResponse(await anyio.to_thread.run_sync(lambda: self.bench.add(name, sample(name))))

    async def rest_pose(self, request: Request) -> Response:
        file = InputFile(await _body(request, LARGEST), _name(request), has_folder=False)
        return JSONResponse(dict((await anyio.to_thread.run_sync(rest_pose_in, file)).rotations))

    async def solve(self, request: Request) -> Response:
        done = await self._done(request)
        known = request.headers.get("x-has", "").split(",")
        return await anyio.to_thread.run_sync(lambda: JSONResponse(without_known(done.motions, known)))

    async def judge(self, request: Request) -> Response:
        done = await self._done(request)
        return await anyio.to_thread.run_sync(lambda: JSONResponse(done.as_data))

    async def dropped(self, _request: Request) -> Response:
        return JSONResponse(self.bench.dropped)

    async def player(self, _request: Request) -> Response:
        return HTMLResponse(html_page("framed", "The player", {}))

    async def take(self, request: Request) -> Response:
        kind = request.path_params["kind"]
        if kind in TOGETHER:
            taken = partial(self.bench.together, await _orders(request), *TOGETHER[kind], tab=_tab(request))
            name, content = await anyio.to_thread.run_sync(taken)
        else:
            done = await self._done(request)
            name, content = await anyio.to_thread.run_sync(done.file, kind)
        return Response(content, media_type="application/octet-stream", headers={"X-Name": json.dumps(name)[1:-1]})

    async def command(self, request: Request) -> Response:
        merged, _ = TOGETHER.get(request.path_params["kind"], (False, False))
        return PlainTextResponse(self.bench.command(await _orders(request), merged))

    async def _done(self, request: Request) -> Done:
        order = Order.of(await _given(request))
        return await anyio.to_thread.run_sync(self.bench.carry_out, order, _tab(request))


async def _body(request: Request, largest: int) -> bytes:
    """The content of a request; a SettingsError if it is too large."""
    length, content = request.headers.get("content-length", "0"), bytearray()
    too_large = length.isdecimal() and int(length) > largest
    async for chunk in request.stream():  # to its end, since browsers hear no answer before
        too_large = too_large or len(content) + len(chunk) > largest
        if too_large:
            content.clear()
        else:
            content += chunk
    if too_large:
        raise SettingsError(f"it is larger than {largest:,} bytes; use the command line")
    return bytes(content)


def _name(request: Request) -> str:
    """What a file is called."""
    return unquote(request.headers.get("x-name", "file"))


def _tab(request: Request) -> str:
    """What the tab of the browser calls itself."""
    return request.headers.get("x-tab", "")[:LONGEST_TAB]


async def _orders(request: Request) -> list[Order]:
    """The order of a request, or its orders."""
    given = await _given(request)
    return [Order.of(each) for each in (given if isinstance(given, list) else [given])]


async def _given(request: Request) -> Any:
    """The JSON of a request."""
    try:
        return json.loads(await _body(request, LARGEST_ORDER))
    except (ValueError, RecursionError):
        raise SettingsError("an order is no JSON") from None


def _refused(status: int) -> Response:
    return PlainTextResponse("", status)
