"""Chromium, which looks at pages of the package for tests."""

import json
import shutil
import subprocess
import threading
from collections.abc import Callable, Iterable
from contextlib import contextmanager
from pathlib import Path

import pytest
import splitnerf_tools

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
    with subprocess.Popen(
        words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as browser:
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


def picture(path: Path, **more: object) -> dict:
    return {"do": "picture", "path": str(path)} | more


def keys(*names: str) -> list[dict]:
    return [{"do": "key", "key": name} for name in names]


def text(name: str, script: str, **more: object) -> dict:
    return {"do": "text", "name": name, "script": script} | more


def wait(script: str, **more: object) -> dict:
    """Until the script is true; the page need not come to rest."""
    return {"do": "wait", "script": script, "restless": True} | more
