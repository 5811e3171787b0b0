"""The viewer's server under connections that say nothing, read nothing, or go."""

from __future__ import annotations

import json
import os
import resource
import select
import socket
import time
from contextlib import ExitStack, contextmanager
from urllib.parse import urlsplit

import pytest
from splitnerf_tools.view import final
from splitnerf_tools.view import server as server_module
from splitnerf_tools.view.assets import ViewedAssets
from splitnerf_tools.view.final import Camera, Tracer
from viewer_server import ask, camera_of, serving


def silent(server) -> socket.socket:
    return socket.create_connection(server.server_address, timeout=5)


def wait_until(wanted) -> None:
    while not wanted():
        time.sleep(0.01)


@contextmanager
def asking_for_pictures(server, **camera):
    """A page that has asked for pictures and has read the answer's first bytes."""
    body, path = json.dumps(camera).encode(), urlsplit(server.url).path
    with socket.create_connection(server.server_address, timeout=20) as page:
        head = (
            f"POST {path}final HTTP/1.1\r\nHost: {urlsplit(server.url).netloc}\r\nContent-Length: {len(body)}\r\n\r\n"
        )
        page.sendall(head.encode() + body)
        assert page.recv(12).startswith(b"HTTP/1.0 200")
        yield page


def test_silent_connections_leave_files_for_the_run(served, monkeypatch):
    monkeypatch.setattr(server_module.Handler, "timeout", 600)
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    used = len(os.listdir("/proc/self/fd"))
    resource.setrlimit(resource.RLIMIT_NOFILE, (used + 2 * server_module.MOST_OPEN + 40, limits[1]))
    try:
        with ExitStack() as stack:
            many = [stack.enter_context(silent(served)) for _ in range(server_module.MOST_OPEN + 20)]
            assert [page.recv(1) for page in many[server_module.MOST_OPEN :]] == [b""] * 20  # closed at once
            with open(__file__):
                pass
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
    wait_until(lambda: served._open == 0)
    assert ask(served, "scene.json")[0] == 200


def test_a_connection_without_a_token_is_closed_soon(shown_run, monkeypatch):
    assert server_module.Handler.timeout < server_module.TIMEOUT
    monkeypatch.setattr(server_module.Handler, "timeout", 0.05)
    with serving(shown_run) as server, silent(server) as page:
        page.sendall(b"GET /")
        assert page.recv(1) == b""
        wait_until(lambda: server._open == 0)


def test_a_page_that_goes_ends_its_request(shown_run, monkeypatch):
    """Whatever the number of its file is, which select() refuses above 1023."""
    monkeypatch.setattr(final, "PASSES", (1,) * 1_000_000)
    monkeypatch.setattr(select, "select", lambda *_: pytest.fail("select() was called"))
    with serving(shown_run) as server:
        with asking_for_pictures(server, **camera_of(16, 16)):
            assert server._open == 1
        wait_until(lambda: server._open == 0)  # else it would not end


def test_who_reads_no_pictures_holds_nothing_up(shown_run, monkeypatch):
    monkeypatch.setattr(final, "PASSES", (1, 1))
    tracer = Tracer(ViewedAssets([shown_run]))
    pictures = tracer.pictures(Camera.of(camera_of(16, 16), 1), lambda: False)
    next(pictures)
    assert not tracer._working.locked()
    tracer.stop()
    assert list(pictures) == []
