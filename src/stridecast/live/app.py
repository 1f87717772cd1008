"""The application: the page, the websocket, files up and down, behind the guard."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket

from stridecast.formats.glb import body_glb
from stridecast.live.hall import Hall
from stridecast.live.messages import PROTOCOL
from stridecast.live.security import Guard, Rules
from stridecast.live.session import LATER, WRONG_PROTOCOL, Session
from stridecast.live.uploads import UploadRefusedError

MISSING = """<!doctype html><html lang="en"><meta charset="utf-8"><title>stridecast</title>
<h1>The page has not been built</h1>
<p>This is a source checkout without the bundle of the page. Build it once and load this address again:</p>
<pre>make page</pre>
<p>The server itself works: clients of your own can use it now, see docs/protocol.md.</p>
</html>
"""


def make_app(hall: Hall, rules: Rules) -> Starlette:
    """The application of a server.

    Parameters
    ----------
    hall
        What its sessions share.
    rules
        Who is answered.
    """

    async def page(_: Request) -> Response:
        index = hall.bundle / "index.html"
        if not index.is_file():
            return Response(MISSING, media_type="text/html", status_code=503)
        return FileResponse(index, headers={"cache-control": "no-cache"})

    async def connect(socket: WebSocket) -> None:
        if PROTOCOL not in socket.scope["subprotocols"]:
            await socket.accept()
            await socket.close(WRONG_PROTOCOL, f"the subprotocol {PROTOCOL} has to be offered")
            return
        if hall.full:
            await socket.accept(subprotocol=PROTOCOL)
            await socket.close(LATER, f"{hall.most_sessions} clients are connected; try again later")
            return
        word = hall.enter()
        try:
            await Session(socket, hall, word).run()
        finally:
            hall.leave(word)

    async def take_file(request: Request) -> Response:
        guest = hall.guests.get(request.query_params.get("session", ""))
        if guest is None:
            return JSONResponse({"error": "there is no such session; connect again, and send the file anew"}, 404)
        if request.headers.get("content-type") != "application/octet-stream":
            return JSONResponse({"error": "a file is sent as it is, with Content-Type: application/octet-stream"}, 415)
        try:
            kept = await guest.uploads.save(request.query_params.get("name", ""), request.stream())
        except UploadRefusedError as error:
            return JSONResponse({"error": str(error)}, error.status, headers={"connection": "close"})
        return JSONResponse({"file": kept, "files": guest.uploads.files, "bytes": guest.uploads.size})

    async def give_body(request: Request) -> Response:
        guest = hall.guests.get(request.query_params.get("session", ""))
        if guest is None:
            return JSONResponse({"error": "there is no such session; connect again"}, 404)
        body = await run_in_threadpool(body_glb, guest.skeleton)
        return Response(body, media_type="model/gltf-binary", headers={"cache-control": "no-store"})

    async def give_character(request: Request) -> Response:
        guest = hall.guests.get(request.query_params.get("session", ""))
        if guest is None or guest.character is None or not guest.character.is_file():
            return JSONResponse({"error": "there is no such session, or it has no character of its own"}, 404)
        return FileResponse(guest.character, media_type="model/gltf-binary", headers={"cache-control": "no-store"})

    async def give_file(request: Request) -> Response:
        found = hall.find(request.path_params["word"])
        if found is None or not found.path.is_file():
            return JSONResponse({"error": "there is no such file any more; make it again"}, 404)
        return FileResponse(found.path, filename=found.name, headers={"cache-control": "no-store"})

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        yield
        hall.close()

    return Starlette(
        routes=[
            Route("/", page),
            WebSocketRoute("/ws", connect),
            Route("/body.glb", give_body),
            Route("/character.glb", give_character),
            Route("/files", take_file, methods=["POST"]),
            Route("/download/{word}", give_file),
            Mount("/assets", StaticFiles(directory=hall.bundle / "assets", check_dir=False)),
        ],
        middleware=[Middleware(Guard, rules=rules)],
        exception_handlers={HTTPException: _tell},
        lifespan=lifespan,
    )


async def _tell(_: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    what = {404: "there is nothing at this address", 405: "this address does not take such a request"}
    said = what.get(error.status_code, error.detail)
    return JSONResponse({"error": said}, status_code=error.status_code, headers=error.headers)
