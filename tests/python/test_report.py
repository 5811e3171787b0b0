"""The report: self-contained, escaped, and complete with and without truth."""

from __future__ import annotations

import os
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from splitnerf.report import write_report
from splitnerf.report.curves import line_chart

VOID = {"meta", "img", "br", "line", "circle", "polyline"}


class Balanced(HTMLParser):
    """Fails on a closing tag that does not match; counts pictures."""

    def __init__(self):
        super().__init__()
        self.open, self.pictures = [], []

    def handle_starttag(self, tag, attributes):
        if tag == "img":
            self.pictures.append(dict(attributes))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        pass

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def make_view(with_truth):
    shape = (6, 6)
    maps = {
        "rgb": np.full((*shape, 3), 0.5), "alpha": np.ones(shape), "albedo": np.full((*shape, 3), 0.2),
        "roughness": np.full(shape, 0.4), "metallic": np.zeros(shape), "normal": np.full((*shape, 3), 0.577),
    }  # fmt: skip
    occlusion = {"occlusion_diffuse": np.ones((*shape, 1)), "occlusion_specular": np.ones((*shape, 3))}
    truth = maps | {"rgb": maps["rgb"] + 0.1, "normal_mask": np.ones(shape, bool)} if with_truth else {"albedo": None}
    return {"name": "r_<0>", "truth": truth, "prediction": maps | occlusion}


def write(tmp_path, **changes):
    light = np.ones((4, 8, 3))
    contents = {
        "title": "a <script>alert(1)</script> scene",
        "summary": {"Key": {"PSNR": 29.321}, "Config": {"light": "<mlp>", "nested": {"on": True, "none": None}}},
        "views": [make_view(True)],
        "lights": [{"roughness": r, "g": light, "g_bar": light} for r in (0, 0.25, 0.5, 1)],
        "light_truth": light,
        "history": [
            {"step": s, "loss": 1 / (s + 1), "psnr": 20 + s, "loss_light": 0.1, "loss_nan": np.nan} for s in range(9)
        ],
        "timings": {"hash_encode": 3.0, "other": 1.0},
    } | changes
    write_report(tmp_path / "report.html", **contents)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    parser = Balanced()
    parser.feed(page)
    assert parser.open == []
    return page, parser.pictures


def test_report_holds_every_part(tmp_path):
    page, pictures = write(tmp_path)
    # 5 maps of truth and 7 of the prediction; 4 lights with estimates and the true one.
    assert len(pictures) == 12 + 9
    assert page.count("<svg") == 3
    assert ">0.1</text>" in re.search(r"Loss</figcaption>.*", page)[0]  # decades, not quarters
    for text in ("20.00 dB", "29.32", "nested.on", "ρ = 0.25", "true light", "hash_encode", "width:75.0%"):
        assert text in page


def test_report_is_self_contained_and_escaped(tmp_path):
    page, pictures = write(tmp_path)
    assert all(picture["src"].startswith("data:image/png;base64,") for picture in pictures)
    assert not re.search(r"https?://|<script|<link|@import", page)
    assert "&lt;script&gt;" in page and "&lt;mlp&gt;" in page and "r_&lt;0&gt;" in page


def test_report_without_truth_or_history(tmp_path):
    page, pictures = write(tmp_path, views=[make_view(False)], lights=[], light_truth=None, history=[], timings={})
    assert len(pictures) == 7
    assert "<h2>Light</h2>" not in page and "<svg" not in page and "dB<" not in page


def test_failed_report_keeps_the_old_one(tmp_path, monkeypatch):
    def replace_unless_page(source, target, replace=os.replace):
        if Path(target).suffix == ".html":
            raise OSError("no space left")
        replace(source, target)

    write(tmp_path)
    before = (tmp_path / "report.html").read_bytes()
    with pytest.raises(KeyError):
        write(tmp_path, lights=[{"g": np.ones((4, 8, 3))}])
    monkeypatch.setattr("os.replace", replace_unless_page)
    with pytest.raises(OSError, match="no space"):
        write(tmp_path, title="new")
    assert (tmp_path / "report.html").read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


def test_chart_places_points_and_drops_what_cannot_be_drawn():
    chart = str(line_chart("loss", {"a": [(0, 1.0), (50, 0.0), (75, float("nan")), (100, 0.01)]}, log=True))
    points = [tuple(map(float, p.split(","))) for p in re.search(r'points="([^"]*)"', chart)[1].split()]
    assert points == [(52, 12), (448, 216)]  # the corners of the plot: a step of 0 at 1, of 100 at 0.01
    assert str(line_chart("empty", {"a": [(0, -1.0)]}, log=True)) == ""


def test_chart_of_a_constant_and_of_many_points():
    assert "<polyline" in line_chart("flat", {"a": [(0, 2.0), (1, 2.0)]})
    chart = str(line_chart("long", {"a": [(i, float(i)) for i in range(10_001)]}))
    assert len(re.search(r'points="([^"]*)"', chart)[1].split()) <= 400
    assert "<b>1e+04</b>" in chart
