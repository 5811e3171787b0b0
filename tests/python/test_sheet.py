"""What the sheet of pictures of an evaluation shows."""

import numpy as np
import pytest
from splitnerf.data.images import linear_to_srgb, over_background, srgb_to_linear
from splitnerf.data.truth import ViewTruth
from splitnerf.evaluate import sheet
from splitnerf.evaluate.scoring import Evaluated, RelitViews
from splitnerf.evaluate.sheet import picture_grid, write_sheet
from test_evaluate import HEIGHT, TILTED, WIDTH, write_asset_views


def test_the_sheet_shows_each_quantity_as_it_is_scored(tmp_path, monkeypatch):
    """On white by its own coverage, scaled by the headline's factor; normals where the truth is known."""
    shown = {}

    def noted(heads, rows):
        shown.update(heads=heads, rows=dict(rows))
        return picture_grid(heads, rows)

    monkeypatch.setattr(sheet, "picture_grid", noted)
    data = write_asset_views(tmp_path).select([0, 1, 2, 0, 1])
    grey = np.full((HEIGHT, WIDTH), 0.25, np.float32)
    colour = np.repeat(grey[..., None], 3, axis=-1)
    normal = np.broadcast_to(TILTED, (HEIGHT, WIDTH, 3))
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[0] = True
    truths = [ViewTruth("a", colour, grey, 2 * grey, normal, mask)] * 5
    alpha = np.full((HEIGHT, WIDTH), 0.8, np.float32)
    prediction = {"rgb": 3 * colour, "alpha": alpha, "albedo": 2 * colour}
    prediction |= {"roughness": 3 * grey, "metallic": grey, "normal": -normal}
    images = [np.full((HEIGHT, WIDTH, 4), 51 * i, np.uint8) for i in range(5)]
    evaluation = {"relight": {"lsq": {"scale": [2.0] * 3}}, "albedo": {"lsq": {"scale": [0.5, 1.0, 2.0]}}}
    relit = RelitViews({"day": images}, data, 1)
    write_sheet(tmp_path / "s.png", Evaluated(evaluation, data, [prediction] * 5, truths, relit))
    rows = shown["rows"]
    assert list(rows) == ["novel view", "relit by\nday", "albedo", "roughness", "metallic", "normal"]
    assert [head.split(":")[0] for head in shown["heads"]] == ["r_0"] * 3 + ["r_2"] * 3 + ["r_1"] * 3

    def on_white(linear, coverage):
        return over_background(np.clip(linear_to_srgb(np.float32(linear)), 0, 1), np.float32(coverage))

    relit = [
        (
            on_white([srgb_to_linear(np.float32(0.3 + 0.2 * (i % 3)))] * 3, 0.3 + 0.2 * (i % 3)),
            on_white([2 * srgb_to_linear(np.float32(0.2 * i))] * 3, 0.2 * i),
        )
        for i in (0, 2, 4)
    ]
    expected = {
        "novel view": [(np.full(3, 0.75), np.full(3, 0.8)) for _ in range(3)],
        "relit by\nday": relit,
        "albedo": [(on_white([0.25] * 3, 0.5), on_white([0.25, 0.5, 1.0], 0.8))] * 3,
        "roughness": [(np.full(3, 0.625), np.full(3, 0.8))] * 3,
        "metallic": [(np.full(3, 0.75), np.full(3, 0.4))] * 3,
        "normal": [(0.5 + 0.5 * TILTED, 0.5 - 0.5 * TILTED)] * 3,
    }
    for name, pairs in expected.items():
        for i, (truth, found) in enumerate(pairs):
            panels = [panel[0, 0] for panel in rows[name][3 * i : 3 * i + 3]]
            for panel, value in zip(panels, (truth, found, np.clip(4 * np.abs(found - truth), 0, 1)), strict=True):
                assert panel == pytest.approx(value, abs=0.03 if name.startswith("relit") else 1e-4), (name, i)
    assert rows["normal"][0][1, 1] == pytest.approx([1, 1, 1])


def test_small_pictures_are_enlarged_and_stand_in_their_rows():
    pictures = [np.full((10, 50, 3), level, np.float32) for level in (0.2, 0.4, 0.6, 0.8)]
    found = picture_grid(["a", "b"], [("one", pictures[:2]), ("two", pictures[2:])])
    assert found.shape == (sheet.LABEL_HEIGHT + 80, sheet.LABEL_WIDTH + 400, 3)
    for k, (row, column) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
        at = found[sheet.LABEL_HEIGHT + 40 * row + 39, sheet.LABEL_WIDTH + 200 * column + 150]
        assert at == pytest.approx([0.2 + 0.2 * k] * 3, abs=0.003)
