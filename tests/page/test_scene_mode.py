"""Scene mode: a place is drawn, people walk in it, and it comes back from its file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from browsers import Visitor

TREE = (0.0, 0.2)


def begin(visitor: Visitor) -> None:
    """Empty ground, seen from above."""
    visitor.go("scene")
    visitor.button("New")
    visitor.press("t")
    visitor.page.mouse.move(500, 40)
    visitor.settle()


def draw(visitor: Visitor) -> None:
    """A road with a tree in its middle, and ten people who want to get by."""
    visitor.press("r")
    visitor.drag((-4.5, 0.0), (4.5, 0.0))
    visitor.slide("Width", 4.4)
    visitor.press("c")
    visitor.drag(TREE, (0.6, 0.2))
    visitor.press("a")
    for k in range(5):
        z = -1.4 + 0.7 * k
        visitor.drag((-4.2, z), (4.2, -z))
        visitor.drag((4.2, z), (-4.2, -z))
    visitor.press("v")
    visitor.until(lambda: len(visitor.page.locator(".thing").all()) == 12, "twelve things")


def test_nobody_walks_through_what_was_drawn(visitor: Visitor) -> None:
    begin(visitor)
    draw(visitor)
    visitor.until(lambda: visitor.last("scene_checked") and visitor.last("people"), "the scene at the server")
    visitor.until(lambda: visitor.frames and visitor.frames[-1].ids.size == 10, "ten people")
    visitor.button("Faster")
    visitor.button("Faster")
    with visitor.recording() as frames:
        visitor.button("Play")
        visitor.until(
            lambda: (visitor.last("player", mode="scene") or {}).get("time", 0) > 9, "nine seconds of the scene"
        )
        visitor.button("Pause")
    sizes = {
        body["id"]: body["radius"] for said in visitor.messages if said["type"] == "people" for body in said["people"]
    }
    tree, gone = 0.6, 0.0
    for frame in frames:
        places = np.array(frame.places[:, :2], float)
        radii = np.array([sizes[i] for i in frame.ids])
        if not len(places):
            continue
        off = np.hypot(*(places - TREE).T)
        assert (off > tree + radii - 0.02).all(), (frame.number, off)
        apart = np.hypot(*np.moveaxis(places[:, None] - places[None], -1, 0))
        np.fill_diagonal(apart, np.inf)
        assert (apart > (radii[:, None] + radii[None]) - 0.01).all(), frame.number
        gone = max(gone, float(frame.speeds.max()))
    assert gone > 0.8
    # what was played can be looked at again
    visitor.page.get_by_label("Time", exact=True).fill("2")
    visitor.until(lambda: visitor.frames[-1].replayed and abs(visitor.frames[-1].time - 2) < 0.1, "two seconds again")


def test_who_is_drawn_while_others_walk_joins_them_and_who_is_deleted_goes(visitor: Visitor) -> None:
    begin(visitor)
    visitor.press("a")
    visitor.drag((-4.0, 0.0), (4.0, 0.0))
    visitor.drag((4.0, 0.5), (-4.0, 0.5))
    visitor.until(lambda: visitor.frames and visitor.frames[-1].ids.size == 2, "two people")
    with visitor.recording() as frames:
        visitor.button("Play")
        visitor.until(lambda: visitor.frames[-1].time > 1.0, "a second")
        visitor.drag((-2.0, -1.5), (4.0, -1.5))
        visitor.until(lambda: visitor.frames[-1].ids.size == 3, "a third one among them")
        visitor.until(lambda: visitor.frames[-1].speeds[-1] > 0.5, "who walks")
        visitor.press("Delete")
        visitor.until(lambda: visitor.frames[-1].ids.size == 2, "two again")
        visitor.button("Pause")
    assert (np.diff([frame.time for frame in frames]) > -1e-9).all(), "time went back"
    assert {said["applied"] for said in visitor.messages if said["type"] == "scene_checked"} <= {
        *("empty", "restarted", "live", "kept")
    }
    for k in (1, 2):  # nobody was put elsewhere
        places = np.array([frame.places[frame.ids.tolist().index(k), :2] for frame in frames])
        assert np.abs(np.diff(places, axis=0)).max() < 0.5


def test_a_search_for_ways_is_shown_and_given_up(visitor: Visitor, tmp_path: Path) -> None:
    """A thicket: ways through it take long."""
    begin(visitor)
    visitor.press("a")
    visitor.drag((-1.0, 0.0), (1.0, 0.0))
    visitor.until(lambda: visitor.frames and visitor.frames[-1].ids.size == 1, "somebody")
    rng = np.random.default_rng(0)
    trees = rng.uniform((0, 0, 0.3), (28, 28, 1.2), (320, 3)).round(2).tolist()
    lines = ["version: 1", "obstacles:", *(f"- {{center: [{x}, {z}], radius: {r}}}" for x, z, r in trees), "people:"]
    lines += [f"- {{start: [{-2 - k}, {2 * k}], goals: [[30, {28 - 2 * k}]]}}" for k in range(14)]
    file = tmp_path / "thicket.yaml"
    file.write_text("\n".join(lines), encoding="utf-8")
    visitor.page.get_by_label("Scene file").set_input_files(file)
    finding = visitor.page.locator(".finding")
    visitor.until(lambda: finding.is_visible() and "Finding ways" in finding.inner_text(), "the search shown")
    finding.get_by_role("button", name="Cancel").click()
    visitor.until(lambda: visitor.last("scene_checked", applied="cancelled"), "the end of the search")
    visitor.until(lambda: "Given up" in visitor.said() and not finding.is_visible(), "what became of it")
    visitor.press("Escape", "Control+z")
    visitor.until(lambda: visitor.messages[-1:] and visitor.last("scene_checked")["applied"] == "kept", "as it was")
    assert visitor.frames[-1].ids.tolist() == [1]


def test_both_panels_are_reached_on_a_narrow_screen_by_the_keyboard_too(visitor: Visitor) -> None:
    page = visitor.page
    page.set_viewport_size({"width": 390, "height": 844})
    visitor.go("scene")
    left, right = page.locator(".panel.left"), page.locator(".panel.right")
    assert left.is_visible()
    assert not right.is_visible()
    page.get_by_role("button", name="Controls", exact=True).focus()
    visitor.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "What is going on"
    visitor.press("Enter")
    assert right.is_visible()
    assert not left.is_visible()
    for mode in ("Walk", "Database", "Scene"):
        visitor.button(mode)
        boxes = page.evaluate(
            """[...document.querySelectorAll("button, input, .panel, .foot > *, canvas.stage")]
                .filter((node) => node.checkVisibility() && !node.closest(".visually-hidden"))
                .map((node) => [node.className, node.getBoundingClientRect()])
                .map(([name, box]) => [name, box.left, box.right])"""
        )
        assert len(boxes) > 8
        assert not [box for box in boxes if box[1] < -0.5 or box[2] > 390.5], mode
    # what is chosen is changed there
    page.get_by_role("button", name="Controls", exact=True).click()
    page.locator(".thing").last.click()
    page.get_by_role("button", name="What is going on", exact=True).click()
    assert page.get_by_label("Name", exact=True).is_visible()
    page.get_by_role("button", name="What is going on", exact=True).click()
    assert not right.is_visible()
    assert not left.is_visible()


def test_somebody_says_why(visitor: Visitor) -> None:
    visitor.go("scene")  # the scene to begin with
    visitor.press("t")
    visitor.settle()
    visitor.until(lambda: visitor.frames and visitor.frames[-1].kind == 2 and visitor.frames[-1].ids.size, "people")
    visitor.button("Play")
    visitor.until(lambda: visitor.frames[-1].time > 6, "six seconds")
    visitor.button("Pause")
    visitor.wait(0.4)
    x, z = min(visitor.frames[-1].places[:, :2].tolist(), key=lambda place: np.hypot(*place))  # beside no panel
    visitor.click(x, z)
    told = visitor.until(lambda: visitor.last("explanation"), "an explanation")
    visitor.until(
        lambda: told["rule"].lower() in visitor.page.locator(".explained").inner_text().lower(), "the rule shown"
    )
    assert len(told["path"]) > 1


def test_a_scene_is_saved_opened_and_undone(visitor: Visitor, tmp_path: Path) -> None:
    begin(visitor)
    draw(visitor)
    names = visitor.page.locator(".thing").all_inner_texts()
    visitor.press("Control+z")
    assert visitor.page.locator(".thing").count() == 11
    visitor.press("Control+y")
    with visitor.page.expect_download() as download:
        visitor.button("Save")
    file = tmp_path / "scene.yaml"
    download.value.save_as(file)
    assert "roads:" in file.read_text(encoding="utf-8")
    visitor.button("New")
    assert visitor.page.locator(".thing").count() == 0
    visitor.page.get_by_label("Scene file").set_input_files(file)
    visitor.until(lambda: visitor.page.locator(".thing").all_inner_texts() == names, "the same things")
    visitor.page.get_by_label("Scene file").set_input_files(
        {"name": "bad.yaml", "mimeType": "text/yaml", "buffer": b"people: [{start: [0, 0], behavior: {velocity: 99}}]"}
    )
    visitor.until(lambda: "velocity" in visitor.said(), "what is wrong with the file")
    assert visitor.page.locator(".thing").all_inner_texts() == names


def test_the_keyboard_alone_will_do(visitor: Visitor) -> None:
    visitor.go()
    page = visitor.page
    reached = []
    for _ in range(12):
        visitor.press("Tab")
        focus = page.evaluate(
            "[document.activeElement.textContent, getComputedStyle(document.activeElement).outlineStyle]"
        )
        reached.append(focus[0])
        assert focus[1] != "none", f"no visible focus on {focus[0]!r}"
        if focus[0] == "Scene":
            break
    assert reached[-1] == "Scene", reached
    visitor.press("Enter")
    visitor.until(lambda: page.title().startswith("Scene"), "scene mode")
    page.get_by_role("button", name="New", exact=True).focus()
    visitor.press("Enter")
    page.locator("canvas.stage").focus()
    visitor.press("t", "r", "ArrowLeft", *["Shift+ArrowLeft"] * 3, "Enter", *["Shift+ArrowRight"] * 6, "Enter", "Enter")
    visitor.press("a", *["Shift+ArrowLeft"] * 5, "Enter", "g", *["Shift+ArrowRight"] * 4, "Enter")
    assert page.locator(".thing").all_inner_texts() == ["road 1", "person 1"]
    visitor.until(
        lambda: visitor.frames and visitor.frames[-1].kind == 2 and visitor.frames[-1].ids.size == 1, "one person"
    )
    visitor.press("Escape", "Escape", "Space")
    visitor.until(lambda: visitor.frames[-1].time > 1.0 and visitor.frames[-1].speeds[0] > 0.3, "somebody who walks")
    visitor.press("Space", "?")
    assert page.get_by_role("dialog").is_visible()
    visitor.press("Escape")
    assert not page.get_by_role("dialog").is_visible()
