"""A headless Chromium for tests: it opens pages, drags things on them and takes pictures."""

from __future__ import annotations

import io
import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

FLAGS = (
    "--headless=new --no-sandbox --disable-gpu --use-angle=swiftshader "
    "--enable-unsafe-swiftshader --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --disable-dev-shm-usage --window-size=960,720"
)

_PATIENCE = 40.0
"""Time limit for software rendering on a busy machine [s]."""


def missing_reason() -> str:
    """Reason why no browser runs here; empty if one does."""
    try:
        import selenium  # noqa: F401
    except ImportError:
        return "selenium is not installed"
    if chromium() is None:
        return "no chromium is installed (apt-get install chromium chromium-driver)"
    if driver() is None:
        return "no chromedriver is installed (apt-get install chromium-driver)"
    return ""


def chromium() -> str | None:
    """Path of the browser."""
    names = ("chromium", "chromium-browser", "google-chrome")
    return next((path for name in names if (path := shutil.which(name))), None)


def driver() -> str | None:
    """Path of its driver."""
    return shutil.which("chromedriver")


@contextmanager
def chrome() -> Iterator[Any]:
    """A browser with an empty profile; the test is skipped without one."""
    if why := missing_reason():
        pytest.skip(why)
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    with TemporaryDirectory(prefix="fantoccini-chrome-", ignore_cleanup_errors=True) as profile:
        options = webdriver.ChromeOptions()
        options.binary_location = chromium()
        for flag in (*FLAGS.split(), f"--user-data-dir={profile}"):
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
        browser = webdriver.Chrome(options, Service(driver()))
        try:
            yield browser
        finally:
            browser.quit()


def until(true: Callable[[], Any], what: str, patience: float = _PATIENCE) -> Any:
    """Wait until a condition holds."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        if result := true():
            return result
        time.sleep(0.05)
    raise AssertionError(f"waited {patience:g} s in vain: {what}")


def picture(browser: Any, name: str = "") -> np.ndarray:
    """Picture (height, width, 3) in the browser.

    With the environment variable FANTOCCINI_SCREENSHOTS the picture is also written there.
    """
    from PIL import Image

    png = browser.get_screenshot_as_png()
    if name and (folder := os.environ.get("FANTOCCINI_SCREENSHOTS")):
        Path(folder, f"{name}.png").write_bytes(png)
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


def count_colours(pixels: np.ndarray) -> int:
    """Number of different colours, in steps of 8."""
    return len(np.unique((pixels // 8).reshape(-1, 3), axis=0))


def count_similar_pixels(pixels: np.ndarray, hue: tuple[int, int, int], off: int = 45) -> int:
    """Number of pixels with the colour of a lit body: same hue, any brightness."""
    flat = pixels.reshape(-1, 3).astype(float)
    bright = flat.max(axis=1)
    wanted = np.array(hue) / max(hue)
    near = np.abs(flat / np.maximum(bright, 1.0)[:, None] - wanted).max(axis=1) < off / 255.0
    return int(np.sum(near & (bright > 50)))


def pixel(client: Any, point: np.ndarray, canvas: dict) -> tuple[float, float]:
    """Pixel in the window of a place in the world.

    Args:
        client: client of viser that looks at it.
        point: (3,) [m].
        canvas: the canvas element's rectangle.
    """
    camera = client.camera
    ahead = camera.look_at - camera.position
    ahead = ahead / np.linalg.norm(ahead)
    right = np.cross(ahead, camera.up_direction)
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    away = np.asarray(point) - camera.position
    depth = away @ ahead
    scale = 0.5 * canvas["height"] / np.tan(0.5 * camera.fov) / depth
    return (
        canvas["x"] + 0.5 * canvas["width"] + scale * float(away @ right),
        canvas["y"] + 0.5 * canvas["height"] - scale * float(away @ up),
    )


def rectangles(browser: Any, selector: str) -> list[dict]:
    """Rectangles of elements in the window [px], read at once: a drawing page answers slowly."""
    return browser.execute_script(
        "return [...document.querySelectorAll(arguments[0])].map((e) => e.getBoundingClientRect())",
        selector,
    )


def canvas(browser: Any) -> dict:
    """The rectangle of the picture in the window."""
    return max(rectangles(browser, "canvas"), key=lambda rect: rect["width"] * rect["height"])


def press(browser: Any, label: str) -> None:
    """Press the button of this name."""
    browser.execute_script(
        "[...document.querySelectorAll('button, [role=button]')]"
        ".find((b) => b.textContent.trim() === arguments[0]).click()",
        label,
    )


def page_text(browser: Any) -> str:
    """Text of the page."""
    return browser.execute_script("return document.body.innerText")


def open_tab(browser: Any, name: str) -> None:
    """Open a tab of the panel, with the mouse."""
    tab = f"[role=tab][title='{name}']"
    until(lambda: rectangles(browser, tab), f"the tab {name}")
    browser.find_element("css selector", tab).click()
    until(lambda: rectangles(browser, f"{tab}[aria-selected=true]"), f"the tab {name} opens")
