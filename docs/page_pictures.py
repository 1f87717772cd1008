"""Pictures of the page in docs/pictures: one a mode, by headless Chromium (software WebGL, so this takes a minute).

python docs/page_pictures.py
"""

from __future__ import annotations

import io
import math
import shutil
import sys
import time
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

from stridecast.live.frames import Frame, decode
from stridecast.live.layout import SCENE
from stridecast.live.serve import LiveServer
from stridecast.samples.library import sample_database

PICTURES = Path(__file__).resolve().parent / "pictures"
FLAGS = "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking"
WEBGL = "--use-angle=swiftshader --enable-unsafe-swiftshader"
RATE = {"walk": 4, "scene": 1, "database": 2}
"""Pictures a second: software draws slowly, and everything else wants its time as well."""

SIZE = {"width": 1440, "height": 800}


def hear(data: str | bytes, frames: list[Frame]) -> None:
    """Keep the binary frames of a websocket."""
    if isinstance(data, bytes):
        frames.append(decode(data))


def save(page: Page, name: str) -> None:
    """Write what is seen."""
    path = PICTURES / f"page_{name}.png"
    Image.open(io.BytesIO(page.screenshot())).convert("RGB").save(path, optimize=True)
    print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB")


def walk(page: Page, _: list[Frame]) -> None:
    """Lead the walker along a winding line."""
    page.wait_for_timeout(1500)
    begun = time.monotonic()
    while (gone := time.monotonic() - begun) < 14:
        page.mouse.move(720 + 300 * math.sin(0.75 * gone), 400 + 110 * math.cos(0.75 * gone))
        page.wait_for_timeout(15)


def scene(page: Page, frames: list[Frame]) -> None:
    """Let the scene to begin with play, and ask about somebody in its middle."""
    page.wait_for_timeout(3000)
    for _ in range(3):
        page.keyboard.press("PageUp")
    page.keyboard.press("Space")
    while frames[-1].kind != SCENE or frames[-1].time < 9:
        page.wait_for_timeout(100)
    page.keyboard.press("Space")
    page.wait_for_timeout(800)
    frame = frames[-1]
    at = min(frame.arrays["places"][:, :2].tolist(), key=lambda place: math.hypot(*place))
    seen = page.evaluate("([x, z]) => window.stridecast.seenAt(x, 0.9, z)", at)
    page.mouse.click(seen["left"], seen["top"])
    page.wait_for_selector(".explained")
    page.mouse.move(700, 150)
    page.wait_for_timeout(2500)


def database(page: Page, _: list[Frame]) -> None:
    """Play a turn."""
    page.wait_for_timeout(4000)
    page.locator(".sort", has_text="Motion").click()
    page.get_by_label("Motion").nth(1).select_option("walk")
    page.wait_for_timeout(500)
    page.locator("tbody tr").nth(3).click()
    page.wait_for_timeout(4500)


def main() -> None:
    """Make them all."""
    chromium = shutil.which("chromium") or sys.exit("no chromium here")
    with LiveServer(sample_database(), port=0).running() as server, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=[*FLAGS.split(), *WEBGL.split()])
        for name, act in {"walk": walk, "scene": scene, "database": database}.items():
            page = browser.new_page(viewport=SIZE)
            frames: list[Frame] = []
            page.on("websocket", lambda socket, kept=frames: socket.on("framereceived", lambda data: hear(data, kept)))
            page.goto(f"{server.address}?ratio=1&pictures={RATE[name]}#{name}")  # leaves time for everything else
            page.wait_for_selector(".curtain.lifted", state="attached", timeout=60_000)
            act(page, frames)
            save(page, name)
            page.close()
        browser.close()


if __name__ == "__main__":
    main()
