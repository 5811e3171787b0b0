"""Chromium, which looks at pages of the package for tests."""

import json
import shutil
import subprocess
import threading
from collections.abc import Callable, Iterable
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import splitnerf_tools
from PIL import Image

SOURCES = Path(splitnerf_tools.__file__).parent / "pages"
LOOK = Path(__file__).parents[1] / "viewer/look.mjs"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
# Else all would be skipped.
assert (SOURCES / "package.json").is_file(), f"the sources of the pages are not in {SOURCES}"
needs_chromium = pytest.mark.skipif(
    not (shutil.which("node") and CHROMIUM and (SOURCES / "node_modules/playwright-core").is_dir()),
    reason="needs node, chromium and `make viewer`",
)


def look_at(url: str, steps: Iterable[dict | Callable[[], object]]) -> dict:
    """What a page says while it does the steps, see tests/viewer/look.mjs; a step that is a function is called here."""
    words = ["node", str(LOOK), str(SOURCES), CHROMIUM, url]
    with subprocess.Popen(words, text=True, **dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)) as browser:
        watch = threading.Timer(400, browser.kill)
        watch.start()
        try:
            for step in steps:
                if callable(step):
                    step()
                    continue
                browser.stdin.write(f"{json.dumps(step)}\n")
                browser.stdin.flush()
                if browser.stdout.readline() != "done\n":
                    raise AssertionError(f"{step}: {browser.stderr.read()[-2000:]}")
            browser.stdin.close()
            return json.loads(browser.stdout.read())
        finally:
            watch.cancel()
            browser.kill()


@contextmanager
def serving(server):
    """A server that answers within the block."""
    with server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


def pixels(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB"), np.float32) / 255


def middle(picture: np.ndarray) -> np.ndarray:
    """The mean colour of the middle's 10 x 10 pixels."""
    y, x = picture.shape[0] // 2, picture.shape[1] // 2
    return picture[y - 5 : y + 5, x - 5 : x + 5].mean(axis=(0, 1))


def picture(path: Path, **more: object) -> dict:
    return {"do": "picture", "path": str(path)} | more


def keys(*names: str) -> list[dict]:
    return [{"do": "key", "key": name} for name in names]


def opened(width: int, height: int, **more: object) -> list[dict]:
    """A window of that size with the page in it."""
    return [{"do": "size", "width": width, "height": height} | more, {"do": "open"} | more]


def text(name: str, script: str, **more: object) -> dict:
    return {"do": "text", "name": name, "script": script} | more


def wait(script: str, **more: object) -> dict:
    """Until the script is true; the page need not come to rest."""
    return {"do": "wait", "script": script, "restless": True} | more
