from __future__ import annotations

import http.client
import json
import socket

import pytest
from websockets.exceptions import InvalidStatus

from live_clients import Client, open_socket
from stridecast.errors import InputError
from stridecast.live.security import CLOSED, COOKIE, Rules, content_policy
from stridecast.live.serve import LiveServer


def ask(server: LiveServer, path: str = "/", method: str = "GET", body: bytes | None = None, **headers: str):
    """An HTTP request with headers as they are given; ``host`` is the server's own if left out."""
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    named = {"host": f"127.0.0.1:{server.port}"} | {name.replace("_", "-"): value for name, value in headers.items()}
    connection.putrequest(method, path, skip_host=True)
    for name, value in named.items():
        connection.putheader(name, value)
    if body is not None:
        connection.putheader("content-length", str(len(body)))
    connection.endheaders(body)
    answer = connection.getresponse()
    data = answer.read()
    connection.close()
    return answer, data


# the rules by themselves


@pytest.mark.parametrize("host", ["127.0.0.1:80", "localhost:80", "LocalHost:80", "[::1]:80", "localhost"])
def test_own_names_are_known(host):
    assert Rules(port=80).knows(host)


@pytest.mark.parametrize(
    "host",
    [
        "evil.example:80",
        "127.0.0.1:81",
        "localhost.evil.example:80",
        "127.0.0.1.evil.example:80",
        "192.168.0.7:80",
        "evil.example",
        "",
        ":80",
        "localhost:80:80",
        "localhost:０80",
        "localhost: 80",
        "localhost:+80",
        "localhost:80@evil.example",
    ],
)
def test_other_names_are_not(host):
    assert not Rules(port=80).knows(host)


def test_numeric_addresses_are_known_where_a_token_protects_them():
    rules = Rules(port=80, addresses=True, token="x", names=("my-machine",))
    assert rules.knows("192.168.0.7:80")
    assert rules.knows("[fe80::1]:80")
    assert rules.knows("my-machine:80")
    assert not rules.knows("evil.example:80")


# HTTP


def test_a_foreign_name_is_refused(server):
    """DNS rebinding: a page of evil.example whose name was made to point at this machine."""
    answer, data = ask(server, host=f"evil.example:{server.port}")
    assert answer.status == 403
    assert answer.headers["content-security-policy"] == CLOSED
    assert "use the address it printed" in json.loads(data)["error"]


def test_no_or_two_names_are_refused(server):
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as raw:
        raw.sendall(b"GET / HTTP/1.1\r\nHost: a\r\nHost: localhost:%d\r\n\r\n" % server.port)
        assert raw.recv(100).split()[1] in (b"400", b"403")
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as raw:
        raw.sendall(b"GET / HTTP/1.0\r\n\r\n")
        assert raw.recv(100).split()[1] == b"403"


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "https://127.0.0.1:1", "http://127.0.0.1:1"])
def test_foreign_origins_are_refused(server, origin):
    answer, data = ask(server, "/files?session=x&name=a.bvh", "POST", b"x", origin=origin)
    assert answer.status == 403
    assert "open its own page" in json.loads(data)["error"]


def test_fetches_of_other_pages_are_refused_but_links_to_the_page_work(server):
    assert ask(server, sec_fetch_site="cross-site", sec_fetch_mode="no-cors")[0].status == 403
    assert ask(server, "/download/x", sec_fetch_site="same-site", sec_fetch_mode="navigate")[0].status == 403
    assert ask(server, sec_fetch_site="cross-site", sec_fetch_mode="navigate")[0].status in (200, 503)


def test_every_answer_says_what_browsers_may_do(server):
    own = f"127.0.0.1:{server.port}"
    for path in ("/", "/nothing", "/download/x", "/assets/x.js"):
        answer, _ = ask(server, path, origin=f"http://{own}")
        policy = answer.headers["content-security-policy"]
        assert policy == content_policy(own)
        assert "unsafe" not in policy
        assert "default-src 'none'" in policy
        assert f"ws://{own}" in policy
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["x-frame-options"] == "DENY"
        assert "access-control-allow-origin" not in answer.headers
        assert "server" not in answer.headers


def test_unknown_addresses_and_methods_are_told(server):
    answer, data = ask(server, "/nothing")
    assert (answer.status, json.loads(data)) == (404, {"error": "there is nothing at this address"})
    assert ask(server, "/files")[0].status == 405
    assert ask(server, "/", "POST", b"")[0].status == 405


@pytest.mark.parametrize(
    "path",
    ["/assets/../hall.py", "/assets/%2e%2e/hall.py", "/assets/..%2f..%2fhall.py", "/download/..%2f..%2fx", "/%00"],
)
def test_no_path_of_the_client_is_opened(server, path):
    assert ask(server, path)[0].status in (400, 404)


def test_without_the_bundle_the_page_says_how_to_build_it(learned, tmp_path):
    server = LiveServer(learned, port=0)
    server.hall.bundle = tmp_path
    with server.running():
        answer, data = ask(server)
    assert answer.status == 503
    assert b"make page" in data


# websocket


def test_foreign_pages_cannot_open_the_websocket(server):
    """Cross-site websocket hijacking: browsers let any page connect, but say which one it is."""
    for origin in ("http://evil.example", "null", f"http://localhost.evil.example:{server.port}"):
        with pytest.raises(InvalidStatus) as caught, open_socket(server, origin=origin):
            pass
        assert caught.value.response.status_code == 403
        assert b"open its own page" in caught.value.response.body


def test_the_own_page_can(server):
    with open_socket(server, origin=f"http://127.0.0.1:{server.port}") as socket:
        assert Client(socket).until("welcome").protocol == "stridecast.1"


# token


@pytest.fixture(scope="module")
def open_server(learned):
    """A server that others could reach; only this machine does."""
    with LiveServer(learned, host="0.0.0.0", port=0).running() as running:
        yield running


def test_other_places_need_the_token(open_server):
    assert open_server.token
    assert f"?token={open_server.token}" in open_server.address
    for path in ("/", "/assets/x", "/download/x", "/?token=", "/?token=wrong", "/?token=%ff%00"):
        answer, data = ask(open_server, path)
        assert answer.status == 403
        assert "token" in json.loads(data)["error"]
        assert open_server.token.encode() not in data
    with pytest.raises(InvalidStatus), open_socket(open_server):
        pass


def test_the_token_opens_once_as_a_cookie(open_server):
    answer, data = ask(open_server, f"/?token={open_server.token}")
    assert answer.status == 200
    assert b'content="0; url=/"' in data
    assert open_server.token.encode() not in data
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    kept = cookie.split(";")[0]
    assert kept.startswith(f"{COOKIE}_{open_server.port}=")
    assert ask(open_server, cookie=kept)[0].status in (200, 503)
    assert ask(open_server, cookie=f"{kept}x")[0].status == 403
    with open_socket(open_server, additional_headers={"cookie": kept}) as socket:
        Client(socket).until("welcome")


def test_the_token_opens_with_each_request(open_server):
    assert ask(open_server, authorization=f"Bearer {open_server.token}")[0].status in (200, 503)
    with open_socket(open_server, query=f"?token={open_server.token}") as socket:
        Client(socket).until("welcome")


def test_the_token_does_not_open_for_other_pages(open_server):
    path = f"/?token={open_server.token}"
    assert ask(open_server, path, origin="http://evil.example")[0].status == 403
    assert ask(open_server, path, host=f"evil.example:{open_server.port}")[0].status == 403


def test_two_servers_have_two_tokens(learned, open_server):
    other = LiveServer(learned, host="0.0.0.0", port=0)
    assert other.token != open_server.token
    other.close()


def test_a_place_that_is_taken_is_refused(learned, server):
    with pytest.raises(InputError, match=f"cannot listen at 127.0.0.1, port {server.port}"):
        LiveServer(learned, port=server.port)
    with pytest.raises(InputError, match="cannot listen at 203"):
        LiveServer(learned, host="203.0.113.77")
