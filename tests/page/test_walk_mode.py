"""Walk mode under mouse, keys and sliders; what the server sent is what counts."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from browsers import Frame, Visitor

ROUNDING = 1e-4
"""Frames carry single precision."""


def speed(frame: Frame) -> float:
    return math.hypot(frame.steering["velocity_x"], frame.steering["velocity_z"])


def assert_lawful(frames: Sequence[Frame]) -> None:
    """Every frame keeps the bounds that were in force in it."""
    assert len(frames) > 20
    for frame in frames:
        s = frame.steering
        assert s["jerk"] <= s["most_jerk"] * (1 + ROUNDING) + ROUNDING, (frame.number, s)
        assert s["least_tangential"] - ROUNDING <= s["tangential"] <= s["most_tangential"] + ROUNDING, (frame.number, s)
        assert abs(s["lateral"]) <= s["most_lateral"] + ROUNDING, (frame.number, s)
        assert speed(frame) <= s["most_speed"] + ROUNDING, (frame.number, s)


def place(frame: Frame) -> np.ndarray:
    return np.array(frame.places[0, :2], float)


def test_the_character_follows_the_mouse_within_its_bounds(visitor: Visitor) -> None:
    visitor.go()
    visitor.press("o")  # the camera rests, so places of the window stay places of the world
    visitor.settle()
    path = [(1.5 * math.sin(t), 1.8 * t) for t in np.linspace(0.4, 2.2, 40)]
    with visitor.recording() as frames:
        for point in path:
            visitor.page.mouse.move(*visitor.seen(*point))
            visitor.wait(0.06)
        visitor.wait(1.5)
    assert_lawful(frames)
    followed = np.array([[f.steering["input_x"], f.steering["input_z"]] for f in frames])
    near_path = [min(np.hypot(*(p - np.array(q))) for q in path) for p in followed[len(followed) // 4 :]]
    assert np.median(near_path) < 0.1  # what is followed is what was drawn
    assert np.hypot(*(place(frames[-1]) - np.array(path[-1]))) < 1.2
    assert max(speed(f) for f in frames) > 0.8
    assert any(frame.echo > 0 for frame in frames)


def test_holding_places_a_target_that_the_mouse_does_not_move(visitor: Visitor) -> None:
    visitor.go()
    visitor.press("o")
    visitor.settle()
    target = (1.0, 2.2)
    visitor.page.mouse.move(*visitor.seen(*target))
    visitor.page.mouse.down()
    visitor.wait(0.7)
    visitor.page.mouse.up()
    visitor.page.mouse.move(*visitor.seen(-2.0, 0.5), steps=5)
    visitor.until(lambda: np.hypot(*(place(visitor.frames[-1]) - np.array(target))) < 0.9, "the walker at the target")
    visitor.press("Escape")
    visitor.until(lambda: speed(visitor.frames[-1]) < 0.05, "a walker who stands")


def test_a_drawn_line_is_walked_to_its_end(visitor: Visitor) -> None:
    visitor.go()
    visitor.press("o")
    visitor.settle()
    visitor.drag((0.0, 0.3), (0.6, 1.2), (0.0, 2.4), (-0.6, 3.2))
    visitor.until(lambda: visitor.last("way", arrived=True), "the end of the line")
    assert np.hypot(*(place(visitor.frames[-1]) - np.array([-0.6, 3.2]))) < 0.5
    assert_lawful(visitor.frames)


def test_keys_drive_until_they_are_let_go(visitor: Visitor) -> None:
    visitor.go()
    keyboard = visitor.page.keyboard
    keyboard.down("w")
    visitor.until(lambda: speed(visitor.frames[-1]) > 0.9, "a walker at speed")
    keyboard.up("w")
    visitor.until(lambda: speed(visitor.frames[-1]) < 0.05, "a walker who stands after key-up")
    keyboard.down("ArrowRight")
    visitor.until(lambda: speed(visitor.frames[-1]) > 0.5, "a walker at speed")
    visitor.page.evaluate("window.dispatchEvent(new Event('blur'))")  # no key-up comes to a page that is left
    visitor.until(lambda: speed(visitor.frames[-1]) < 0.05, "a walker who stands after the page was left")
    keyboard.up("ArrowRight")


def test_sliders_and_numbers_reach_the_walker(visitor: Visitor) -> None:
    visitor.go()
    visitor.press("2")
    visitor.slide("Speed", 0.8)
    visitor.slide("Turning", 0.4)
    visitor.slide("Mood", 0.5)
    visitor.page.get_by_label("Movements").first.select_option("lively")
    wanted = {"motion": "walk", "speed": 0.8, "turn": 0.4, "style": 0.5, "size": "lively"}
    visitor.until(lambda: visitor.last("settings_state", **wanted), "the settings at the server")
    visitor.page.locator("canvas.stage").focus()
    visitor.page.keyboard.down("w")
    visitor.until(lambda: speed(visitor.frames[-1]) > 0.7, "a walker at speed")
    with visitor.recording() as frames:
        visitor.wait(1.5)
    visitor.page.keyboard.up("w")
    assert all(0.6 < speed(frame) < 0.85 for frame in frames)
    visitor.press("3")
    state = visitor.until(lambda: visitor.last("settings_state", motion="run"), "running")
    assert state["speed"] > 2.0  # another motion brings its own speed along


def test_a_gamepad_pushes_and_its_buttons_choose(visitor: Visitor) -> None:
    visitor.page.add_init_script(
        """const buttons = Array.from({ length: 17 }, () => ({ pressed: false }));
        window.pad = { connected: true, axes: [0, 0, 0, 0], buttons };
        navigator.getGamepads = () => [null, window.pad, null, null];"""
    )
    visitor.go()
    visitor.press("o")
    visitor.settle()
    begin = place(visitor.frames[-1])
    visitor.page.evaluate("() => { window.pad.axes = [0.05, -1, 0, 0]; }")
    visitor.until(lambda: speed(visitor.frames[-1]) > 0.8, "a walker at speed")
    with visitor.recording() as frames:
        visitor.wait(1.0)
    assert_lawful(frames)
    assert np.hypot(*(place(visitor.frames[-1]) - begin)) > 0.8
    visitor.page.evaluate("() => { window.pad.axes = [0, 0, 0, 0]; }")
    visitor.until(lambda: speed(visitor.frames[-1]) < 0.05, "a walker who stands when the stick is let go")
    visitor.page.evaluate("() => { window.pad.buttons[1].pressed = true; }")
    visitor.until(lambda: visitor.last("settings_state", motion="run"), "running")
