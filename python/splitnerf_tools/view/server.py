"""The viewer's web server: it answers from memory, and only to requests with its token.

The first part of every path is a random token, so that neither other users of the machine nor pages in the same browser
can use it. `Host` and `Origin` are checked too, against DNS rebinding.
"""

from __future__ import annotations

import hmac
import ipaddress
import json
import secrets
import select
import socket
import socketserver
import struct
import sys
import threading
from contextlib import closing, suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from importlib.resources import files
from itertools import chain
from typing import TYPE_CHECKING
from urllib.parse import parse_qs, urlsplit

from splitnerf.errors import InputError, plain
from splitnerf.files import reason

from splitnerf_tools.report.embedding import as_halves
from splitnerf_tools.view.assets import ViewedAssets, ViewedPhotos
from splitnerf_tools.view.events import EventStream
from splitnerf_tools.view.final import Camera, Tracer

if TYPE_CHECKING:
    from splitnerf_tools.view.live import Live

LARGEST_UPLOAD = 128 << 20  # bytes of a light
LARGEST_QUESTION = 1 << 16  # bytes of a camera
PICTURE = struct.Struct("<5I")  # asset, width, height, paths a pixel, bytes that follow
WITHOUT_REST = ("", "scene.json", "final", "events")  # addresses that nothing follows
# Seconds: until the token of a connection is checked, and that it may be silent after.
FIRST_TIMEOUT, TIMEOUT = 5.0, 60.0
MOST_OPEN = 64  # connections at a time: the run that is shown needs files too
SAFETY = {
    "Content-Security-Policy": "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src 'self' blob: data:; "
    "connect-src 'self' blob:; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class Refused(Exception):
    """A request that is not answered: a status, and one line for the page."""

    def __init__(self, status: HTTPStatus, line: str):
        super().__init__(line)
        self.status = status


class ViewServer(socketserver.ThreadingMixIn, socketserver.TCPServer):
    """Serves the page, its assets and lights; each request has a thread of its own. Raises InputError where the address or the port
    cannot be used.

    Args:
        photos: The photos whose cameras are shown, or None.
        port: The port; 0 takes a free one.
        live: The run in training, or None.

    Attributes:
        url: The address of the page, token included.
        events: The states for open pages.
    """

    daemon_threads = True
    allow_reuse_address = True
    request_queue_size = MOST_OPEN  # connections that wait; more would try again after a second

    def __init__(
        self,
        shown: ViewedAssets,
        photos: ViewedPhotos | None = None,
        host: str = "127.0.0.1",
        port: int = 0,
        live: Live | None = None,
    ):
        self.shown, self.photos, self.host, self.tracer, self.live = shown, photos, host, Tracer(shown), live
        self.events = EventStream() if live is None else live.events
        page, script = files("splitnerf_tools.view") / "viewer.html", files("splitnerf_tools.report") / "pages.js"
        self.page = page.read_bytes().replace(b"{{SCRIPT}}", script.read_bytes())
        self.uploading = threading.Lock()
        self._token = secrets.token_urlsafe(16)
        self._open, self._counting = 0, threading.Lock()
        self.address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            super().__init__((host, port), Handler)
        except OSError as error:
            raise InputError(
                f"{host}, port {port}: cannot be listened at ({reason(error)}); give another --host or --port"
            ) from None
        name = {"0.0.0.0": socket.gethostname(), "::": socket.gethostname()}.get(
            host, f"[{host}]" if ":" in host else host
        )
        self.url = f"http://{name}:{self.server_address[1]}/{self._token}/"

    def inner_path(self, path: str) -> str | None:
        """What follows the token in a path; None where the token is missing or wrong."""
        token, _, inner = path.lstrip("/").partition("/")
        return inner if hmac.compare_digest(token.encode(), self._token.encode()) else None

    def is_own(self, address: str) -> bool:
        """Whether a `Host`, or an `Origin` without its scheme, is this server's: a name of another machine may lead here."""
        try:
            parts = urlsplit(f"//{address}")
            name, port = parts.hostname or "", parts.port or 80
        except ValueError:
            return False
        if port != self.server_address[1]:
            return False
        if name in ("localhost", "127.0.0.1", "::1", self.host.lower(), urlsplit(self.url).hostname):
            return True
        return self.host in ("0.0.0.0", "::") and is_number(name)

    def verify_request(self, request, client_address) -> bool:
        """Whether one connection more may be open; else it is closed at once."""
        return self._open < MOST_OPEN

    def process_request(self, request, client_address) -> None:
        self._count(1)
        try:
            super().process_request(request, client_address)
        except BaseException:  # no thread could be started
            self._count(-1)
            raise

    def process_request_thread(self, request, client_address) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._count(-1)

    def _count(self, change: int) -> None:
        with self._counting:
            self._open += change

    def server_close(self) -> None:
        """Sends the end to the pages, ends the tracing, and closes the socket."""
        self.events.end("splitnerf has ended; what is loaded stays here")
        self.tracer.stop()
        super().server_close()

    def handle_error(self, request, client_address) -> None:
        """One line for an error in a thread, but none for a page that was closed."""
        error = sys.exc_info()[1]
        if not isinstance(error, (ConnectionError, TimeoutError)):
            print(f"splitnerf: note: a request failed ({plain(f'{type(error).__name__}: {error}')})", file=sys.stderr)


def is_number(name: str) -> bool:
    """Whether a host is written as an IP address, which no other name server can have given."""
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


class Handler(BaseHTTPRequestHandler):
    """Answers one request."""

    server: ViewServer
    timeout = FIRST_TIMEOUT
    server_version, sys_version = "splitnerf", ""

    def setup(self) -> None:
        """Closes the connection later, unless a token comes in time: a byte now and then does not count."""
        super().setup()
        self.deadline = threading.Timer(self.timeout, self._hang_up)
        self.deadline.daemon = True
        self.deadline.start()

    def finish(self) -> None:
        self.deadline.cancel()
        super().finish()

    def _hang_up(self) -> None:
        with suppress(OSError):
            self.connection.shutdown(socket.SHUT_RDWR)

    def do_GET(self) -> None:
        self._answered(
            {
                "": self._page,
                "scene.json": self._scene,
                "assets": self._asset,
                "lights": self._light,
                "photos": self._photo,
                "events": self._events,
                "curves": self._curves,
            }
        )

    def do_POST(self) -> None:
        self._answered({"lights": self._dropped, "final": self._final, "control": self._control})

    def log_message(self, format: str, *args: object) -> None:
        """Prints nothing: the terminal is for errors."""

    def _answered(self, answers: dict) -> None:
        """Checks where a request comes from, and answers it with the function of its path."""
        try:
            inner = self._checked_path()
            name, _, rest = inner.partition("/")
            if name not in answers or (rest and name in WITHOUT_REST):
                raise Refused(HTTPStatus.NOT_FOUND, "there is nothing at this address")
            answers[name](rest)
        except Refused as refused:
            self._send_json({"error": str(refused)}, refused.status)
        except InputError as error:
            self._send_json({"error": str(error)}, HTTPStatus.UNPROCESSABLE_ENTITY)

    def _checked_path(self) -> str:
        """What follows the token in the path of a request that may be answered."""
        origin = self.headers.get("Origin")
        own = self.server.is_own(self.headers.get("Host", ""))
        if not own or (origin is not None and not (origin.startswith("http://") and self.server.is_own(origin[7:]))):
            raise Refused(
                HTTPStatus.FORBIDDEN, "this request comes from another page; open the address that splitnerf printed"
            )
        inner = self.server.inner_path(urlsplit(self.path).path)
        if inner is None:
            raise Refused(
                HTTPStatus.FORBIDDEN, "the token is missing or wrong; open the address that splitnerf printed"
            )
        self.deadline.cancel()
        self.connection.settimeout(TIMEOUT)
        return inner

    def _page(self, _: str) -> None:
        self._send(self.server.page, "text/html; charset=utf-8")

    def _scene(self, _: str) -> None:
        if self.server.live is not None:
            self.server.live.load()
        cameras = [] if self.server.photos is None else self.server.photos.cameras()
        self._send_json(
            self.server.shown.description() | {"cameras": cameras, "training": self.server.live is not None}
        )

    def _asset(self, rest: str) -> None:
        number = self._number(rest)
        if number >= len(self.server.shown.sources):
            raise Refused(HTTPStatus.NOT_FOUND, "there is no such asset")
        source = self.server.shown.sources[number]
        self._send(source.content, "model/gltf-binary")
        if self.server.live is not None:
            self.server.live.taken(source)

    def _events(self, _: str) -> None:
        """A stream of the newest state, as server-sent events; it ends where the page closes it."""
        self._send_head("text/event-stream")
        for state in self.server.events.listen(self._is_gone):
            self.wfile.write(b"data: " + json.dumps(state).encode() + b"\n\n")

    def _curves(self, rest: str) -> None:
        """The lines of the log from a number on."""
        self._send_json(self._training().lines(self._number(rest)))

    def _control(self, rest: str) -> None:
        self._training().ask(rest)
        self._send_json({})

    def _training(self) -> Live:
        if self.server.live is None:
            raise Refused(HTTPStatus.NOT_FOUND, "no run is trained here")
        return self.server.live

    def _light(self, rest: str) -> None:
        light = self.server.shown.light(self._number(rest))
        if light is None:
            raise Refused(HTTPStatus.NOT_FOUND, "this light is no longer kept; drop it again")
        width, height, content = as_halves(light.radiance)
        self._send(content, "application/octet-stream", Picture_Size=f"{width}x{height}")

    def _photo(self, rest: str) -> None:
        number = self._number(rest)
        if self.server.photos is None or number >= len(self.server.photos):
            raise Refused(HTTPStatus.NOT_FOUND, "there is no such photo")
        self._send(self.server.photos.png(number), "image/png")

    def _final(self, _: str) -> None:
        """A stream of pictures, each after its PICTURE; it ends where the page closes it, or asks for another one."""
        try:
            content = json.loads(self._body(LARGEST_QUESTION))
        except (ValueError, RecursionError):
            raise Refused(HTTPStatus.BAD_REQUEST, "the camera is no JSON; load the page again") from None
        camera = Camera.of(content, len(self.server.shown.sources))
        with closing(self.server.tracer.pictures(camera, self._is_gone)) as pictures:
            first = next(pictures, None)  # before the head, so that an error can still be sent
            self._send_head("application/octet-stream")
            for picture in () if first is None else chain([first], pictures):
                sizes = (picture.asset, picture.width, picture.height, picture.spp, len(picture.content))
                self.wfile.write(PICTURE.pack(*sizes) + picture.content)

    def _is_gone(self) -> bool:
        """Whether the page has closed this connection."""
        asked = select.poll()  # select() refuses numbers of files above 1023
        asked.register(self.connection, select.POLLIN)
        return bool(asked.poll(0)) and not self.connection.recv(1, socket.MSG_PEEK)

    def _dropped(self, rest: str) -> None:
        name = parse_qs(urlsplit(self.path).query).get("name", ["light"])[0]
        if rest:
            raise Refused(HTTPStatus.NOT_FOUND, "there is nothing at this address")
        with self.server.uploading:
            number = self.server.shown.drop(name, self._body(LARGEST_UPLOAD))
        self._send_json({"number": number})

    def _body(self, most: int) -> bytes:
        """The body of a request, of at most so many bytes."""
        length = self.headers.get("Content-Length", "")
        if not (length.isascii() and length.isdigit() and len(length) < 16):
            raise Refused(HTTPStatus.LENGTH_REQUIRED, "the request does not say how long it is")
        if int(length) > most:
            raise Refused(
                HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"the file is larger than {most >> 20} MB; make it smaller"
            )
        body = self.rfile.read(int(length))
        if len(body) < int(length):
            raise Refused(HTTPStatus.BAD_REQUEST, "the request ended early")
        return body

    def _number(self, text: str) -> int:
        if not (text.isascii() and text.isdigit() and len(text) < 10):
            raise Refused(HTTPStatus.NOT_FOUND, "there is nothing at this address")
        return int(text)

    def _send_json(self, content: object, status: HTTPStatus = HTTPStatus.OK) -> None:
        self._send(json.dumps(content).encode(), "application/json", status)

    def _send(self, content: bytes, kind: str, status: HTTPStatus = HTTPStatus.OK, **headers: str) -> None:
        self._send_head(kind, status, Content_Length=str(len(content)), **headers)
        self.wfile.write(content)

    def _send_head(self, kind: str, status: HTTPStatus = HTTPStatus.OK, **headers: str) -> None:
        """Sends the head of an answer; names of headers have _ for -."""
        self.send_response(status)
        for name, value in (SAFETY | {"Content-Type": kind} | headers).items():
            self.send_header(name.replace("_", "-"), value)
        self.end_headers()
