"""The page as a whole: its size, its server that goes and comes, visitors side by side, nonsense, own recordings."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from browsers import Visitor
from stridecast.formats.motion_files import write_motion
from stridecast.formats.recordings import load_motion
from stridecast.live.serve import LiveServer
from stridecast.model.database import MotionDatabase

ROOT = Path(__file__).resolve().parent.parent.parent
STATIC = ROOT / "src" / "stridecast" / "live" / "static"


def test_the_bundle_is_small_and_names_no_other_host() -> None:
    files = [path for path in STATIC.rglob("*") if path.is_file()]
    assert files, "no bundle: make page"
    assert sum(path.stat().st_size for path in files) < 1_000_000
    html = (STATIC / "index.html").read_text(encoding="utf-8")
    assert not re.search(r"(src|href)=\"(https?:)?//", html)
    assert not re.search(r"<style|<script>| style=| on\w+=", html)  # the content security policy forbids them


def test_text_can_be_read() -> None:
    """Contrasts of the style sheet's colours of text and grounds."""
    css = (ROOT / "web" / "src" / "ui" / "style.css").read_text(encoding="utf-8")
    colours = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{3,6});", css))

    def light(colour: str) -> float:
        digits = colour[1:] if len(colour) == 7 else "".join(2 * c for c in colour[1:])
        channels = [int(digits[i : i + 2], 16) / 255 for i in (0, 2, 4)]
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    def contrast(a: str, b: str) -> float:
        bright, dark = sorted((light(colours.get(a, a)), light(colours.get(b, b))), reverse=True)
        return (bright + 0.05) / (dark + 0.05)

    pairs = [("ink", "solid"), ("soft", "solid"), ("soft", "faint"), ("soft", "ground"), ("accent", "solid")]
    pairs += [("accent-dark", "accent-faint"), ("accent-dark", "solid"), ("#9a3408", "hit-faint"), ("bad", "solid")]
    for a, b in pairs:
        assert contrast(a, b) >= 4.5, (a, b, contrast(a, b))


def test_what_was_done_survives_the_server(visit: Callable[[str], Visitor], learned: MotionDatabase) -> None:
    first = LiveServer(learned, port=0)
    with first.running():
        visitor = visit(first.address)
        visitor.forgiven = ("WebSocket connection", "ERR_CONNECTION_REFUSED")
        visitor.go("walk")
        visitor.slide("Speed", 0.9)
        visitor.until(lambda: visitor.last("settings_state", speed=0.9), "the speed at the server")
        visitor.button("Scene")
        visitor.button("New")
        visitor.press("t", "a")
        visitor.settle()
        visitor.drag((-2.0, 0.0), (2.0, 0.0))
        visitor.until(lambda: visitor.frames[-1].kind == 2 and visitor.frames[-1].ids.size == 1, "one person")
    visitor.until(lambda: visitor.page.locator('[data-link="waiting"]').count(), "a page that knows")
    visitor.frames.clear()
    visitor.messages.clear()
    with LiveServer(learned, port=first.port).running():
        visitor.until(lambda: visitor.last("welcome"), "the second server")
        visitor.until(lambda: visitor.last("settings_state", speed=0.9), "the speed at the second server")
        visitor.until(lambda: visitor.frames and visitor.frames[-1].kind == 2, "frames of the scene")
        visitor.until(lambda: visitor.frames[-1].ids.size == 1, "the person again")
        visitor.page.context.close()


def test_two_visitors_each_have_a_walker(visit: Callable[[str], Visitor], server: LiveServer) -> None:
    one, other = visit(server.address), visit(server.address)
    one.go()
    other.go()
    one.page.keyboard.down("w")
    one.until(lambda: one.frames[-1].speeds[0] > 0.8, "one who walks")
    other.until(lambda: len(other.frames) > 10, "frames for the other")
    assert other.frames[-1].speeds[0] < 0.05
    one.page.keyboard.up("w")


@pytest.mark.parametrize("nonsense", ["'{'", '\'{"type": "dance"}\'', "'x'.repeat(5 * 2 ** 20)"])
def test_nonsense_harms_nobody(visitor: Visitor, nonsense: str) -> None:
    visitor.go()
    visitor.page.evaluate(
        f"""() => new Promise(done => {{
            const socket = new WebSocket(`ws://${{location.host}}/ws`, "stridecast.1");
            let told = false;
            socket.onopen = () => socket.send({nonsense});
            socket.onmessage = ({{ data }}) => {{
                if (typeof data === "string" && JSON.parse(data).type === "error") done(told = true);
            }};
            socket.onclose = () => done(told = true);
        }})"""
    )
    with visitor.recording() as frames:
        visitor.wait(1.0)
    assert len(frames) > 10


def test_own_recordings_become_a_database(visitor: Visitor, formula_takes: Path, tmp_path: Path) -> None:
    visitor.go("database")
    visitor.until(lambda: visitor.page.locator("tbody tr").count() > 20, "the segments")
    visitor.until(lambda: visitor.frames and visitor.frames[-1].kind == 3 and visitor.frames[-1].ids.size, "a clip")
    assert visitor.frames[-1].ids.tolist() == [1, 2]
    visitor.drop([("notes.txt", "hello")])
    visitor.until(lambda: "notes.txt" in visitor.said(), "what is wrong with notes.txt")
    visitor.drop([(path.name, path.read_text(encoding="ascii")) for path in sorted(formula_takes.glob("*.bvh"))])
    visitor.until(lambda: "3 files" in visitor.page.locator(".file-list").inner_text(), "three files at the server")
    picker = visitor.page.get_by_label("Recordings")
    assert picker.get_attribute("accept") == ".bvh,.amc,.npz,.c3d,.glb,.vrma,.asf"
    write_motion(tmp_path / "03_01.glb", load_motion(formula_takes / "01_01.bvh"))
    broken = [tmp_path / name for name in ("broken.npz", "broken.c3d")]
    for path in broken:
        path.write_bytes(bytes(range(256)))
    picker.set_input_files([tmp_path / "03_01.glb", *broken])
    visitor.until(lambda: "6 files" in visitor.page.locator(".file-list").inner_text(), "six files at the server")
    visitor.button("Build a database")
    visitor.until(lambda: visitor.last("progress"), "progress")
    built = visitor.until(lambda: visitor.last("built") or visitor.last("error", code="build"), "a database")
    assert built["type"] == "built", built
    assert (built["takes"], built["left_out"]) == (4, 2)
    visitor.button("Use it")
    visitor.until(lambda: visitor.last("welcome")["database"]["built"], "the database in use")
    visitor.until(lambda: visitor.frames[-1].kind == 3, "a clip of it")


def test_the_page_says_how_to_start_where_nobody_answers(visit: Callable[[str], Visitor], server: LiveServer) -> None:
    visitor = visit(server.address)
    visitor.forgiven = ("WebSocket", "ERR_")
    visitor.page.route_web_socket("**/ws", lambda socket: socket.close())
    visitor.page.goto(visitor.address)
    visitor.until(lambda: "stridecast demo" in visitor.page.locator(".curtain").inner_text(), "what to do")
