"""Who is answered: nobody who comes by another page, by another name, or without the token.

A page of somebody else that runs in the user's browser can send requests to this machine. It is told from our own by
the ``Origin`` that browsers add (cross-site requests, websocket hijacking) and by the ``Host`` that it had to use (DNS
rebinding: a foreign name made to point here).
"""

from __future__ import annotations

import hmac
import ipaddress
from collections.abc import Iterable
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

COOKIE = "stridecast"
"""Name of the cookie that holds the token; the port is added, as cookies know no ports."""

OWN_NAMES = ("localhost", "127.0.0.1", "::1")
"""By which a server on this machine may be called."""


CLOSED = "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
"""Policy of what is no part of the page."""

_ONWARD = '<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="0; url=/"><title>stridecast</title>'
"""Leads on to the page from here: after a redirect that another site began, a strict cookie would not be sent."""


@dataclass(frozen=True, kw_only=True)
class Rules:
    """Who may come.

    Parameters
    ----------
    port
        Where the server listens.
    names
        Names by which it may be called beside ``OWN_NAMES``.
    token
        What must be known; nothing where only this machine can come.
    addresses
        Whether it may be called by any numeric address (no name can be made to point elsewhere then).
    """

    port: int
    names: tuple[str, ...] = ()
    token: str | None = None
    addresses: bool = False

    def knows(self, host: str) -> bool:
        """Whether a ``Host`` header is one of the server's own."""
        name, port = _split(host)
        if port != self.port:
            return False
        return name in OWN_NAMES or name in self.names or (self.addresses and _is_address(name))


class Guard:
    """Lets pass who may, and adds to every answer what browsers are to keep to."""

    def __init__(self, app: ASGIApp, rules: Rules) -> None:
        self.app, self.rules = app, rules

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, refuse or hand on a request."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = _headers(scope["headers"])
        answer = self._refusal(scope, headers)
        policy = CLOSED if answer is not None else content_policy(headers["host"][0])

        async def sending(message: Message) -> None:
            if message["type"] in ("http.response.start", "websocket.http.response.start"):
                message["headers"] = [*message["headers"], *_answer_headers(policy)]
            await send(message)

        if answer is None:
            await self.app(scope, receive, sending)
        elif scope["type"] == "http":
            await answer(scope, receive, sending)
        else:
            await _deny(answer, sending)

    def _refusal(self, scope: Scope, headers: dict[str, list[str]]) -> Response | None:
        hosts, origins = headers.get("host", []), headers.get("origin", [])
        if len(hosts) != 1 or not self.rules.knows(hosts[0]):
            return _forbidden(
                f"this server is not called {' or '.join(hosts) or 'nothing'}; use the address it printed"
            )
        if any(origin.lower() not in (f"http://{hosts[0]}".lower(),) for origin in origins):
            return _forbidden(f"pages of {origins[0]} may not use this server; open its own page")
        if headers.get("sec-fetch-site", [""])[0] in ("cross-site", "same-site") and not _is_visit(scope, headers):
            return _forbidden("pages of others may not use this server; open its own page")
        if self.rules.token is None:
            return None
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        cookie = f"{COOKIE}_{self.rules.port}"
        if given and scope["type"] == "http" and scope["path"] == "/" and self._is_token(given):
            answer: Response = HTMLResponse(_ONWARD, headers={"cache-control": "no-store"})
            answer.set_cookie(cookie, self.rules.token, httponly=True, samesite="strict")
            return answer
        bearer = [h.removeprefix("Bearer ") for h in headers.get("authorization", []) if h.startswith("Bearer ")]
        if self._is_token([*given, *bearer, *_cookies(headers.get("cookie", []), cookie)]):
            return None
        return _forbidden(
            "the token is missing or wrong; open the whole address that the command printed, with ?token="
        )

    def _is_token(self, given: Iterable[str]) -> bool:
        right = (self.rules.token or "").encode()
        return any(hmac.compare_digest(text.encode(), right) for text in given)


def content_policy(host: str) -> str:
    """What the page may load: its own files and its own websocket."""
    return (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; font-src 'self'; "
        f"connect-src 'self' blob: ws://{host}; worker-src 'self' blob:; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'none'"
    )


def _answer_headers(policy: str) -> list[tuple[bytes, bytes]]:
    named = {
        "content-security-policy": policy,
        "x-content-type-options": "nosniff",
        "x-frame-options": "DENY",
        "referrer-policy": "no-referrer",
        "cross-origin-resource-policy": "same-origin",
        "cross-origin-opener-policy": "same-origin",
    }
    return [(name.encode(), value.encode("latin-1")) for name, value in named.items()]


def _is_visit(scope: Scope, headers: dict[str, list[str]]) -> bool:
    """Whether somebody has followed a link to the page itself."""
    mode = headers.get("sec-fetch-mode", [""])[0]
    return scope["type"] == "http" and scope["method"] == "GET" and scope["path"] == "/" and mode == "navigate"


def _forbidden(what: str) -> Response:
    return JSONResponse({"error": what}, status_code=403)


async def _deny(answer: Response, send: Send) -> None:
    """Answer a websocket's handshake by HTTP."""
    await send({"type": "websocket.http.response.start", "status": answer.status_code, "headers": answer.raw_headers})
    await send({"type": "websocket.http.response.body", "body": answer.body})


def _headers(raw: Iterable[tuple[bytes, bytes]]) -> dict[str, list[str]]:
    out: dict[str, list[str]] = {}
    for name, value in raw:
        out.setdefault(name.decode("latin-1").lower(), []).append(value.decode("latin-1"))
    return out


def _cookies(headers: Iterable[str], name: str) -> list[str]:
    out = []
    for header in headers:
        try:
            found = SimpleCookie(header).get(name)
        except CookieError:
            continue
        if found is not None:
            out.append(found.value)
    return out


def _split(host: str) -> tuple[str, int]:
    """Name and port of a ``Host``; port 0 where it is none."""
    name, colon, port = host.lower().rpartition(":")
    if not colon or port.endswith("]"):
        return host.lower().strip("[]"), 80
    if not (port.isascii() and port.isdecimal() and len(port) <= 5):
        return "", 0
    return name.removeprefix("[").removesuffix("]"), int(port)


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
