"""A viewer's server in a thread, what it shows, and requests to it."""

import http.client
import json
from urllib.parse import urlsplit

import looking_at
import numpy as np
from gltf_builder import Gltf
from painted_ball import looking
from splitnerf_tools.view.assets import ViewedAssets
from splitnerf_tools.view.server import ViewServer


def numbered_sky(height=8):
    """Every texel has its own radiance."""
    return np.arange(1, height * 2 * height * 3 + 1, dtype=np.float32).reshape(height, 2 * height, 3) / 64


def triangle():
    """A document of one grey triangle."""
    document = Gltf()
    grey = document.material(pbrMetallicRoughness={"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0})
    document.node(mesh=document.mesh(document.primitive(material=grey)))
    return document


def serving(*paths, light=None, photos=None, host="127.0.0.1"):
    """A viewer's server of these assets, which answers within the block."""
    return looking_at.serving(ViewServer(ViewedAssets(list(paths), light), photos, host))


def ask(server, path, *, method="GET", body=None, token=True, **headers):
    """(status, headers, body) of one request; header names have _ for -."""
    connection = http.client.HTTPConnection("127.0.0.1", server.server_address[1], timeout=20)
    connection.putrequest(method, (urlsplit(server.url).path if token else "/") + path, skip_host="Host" in headers)
    if body is not None and "Content_Length" not in headers:
        headers["Content_Length"] = str(len(body))
    for name, value in headers.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders(body)
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer.status, answer.headers, content


def error_of(answer):
    return answer[0], json.loads(answer[2])["error"]


def halves(answer):
    width, height = map(int, answer[1]["Picture-Size"].split("x"))
    return np.frombuffer(answer[2], "<f2").reshape(height, width, 4)


def camera_of(width, height, **changes):
    """A camera 3 above the triangle's plane that sees all of it, for JSON."""
    pose = looking(-np.pi / 2, 0.0) + np.array([[0, 0, 0, 0.4], [0, 0, 0, 0], [0, 0, 0, 0.4], [0, 0, 0, 0]])
    lens = [1.5 * width, 1.5 * width, width / 2, height / 2]
    seen = {"pose": pose.ravel().tolist(), "intrinsics": lens, "width": width, "height": height}
    return seen | {"turn": 0, "lights": [0]} | changes
