"""A sheet of pictures: truth, prediction and error of a few views, per map and per material quantity."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from splitnerf.data.dataset import spread
from splitnerf.data.images import over_background, to_uint8, write_image
from splitnerf.evaluate.protocol import on_white
from splitnerf.evaluate.scoring import Evaluated

SHEET_VIEWS = 3
ERROR_GAIN = 4
LABEL_HEIGHT, LABEL_WIDTH = 18, 130
PANEL_WIDTH = 160  # smaller images are enlarged by a whole factor

Row = tuple[str, list[tuple[np.ndarray, np.ndarray]]]


def write_sheet(path: Path, evaluated: Evaluated) -> None:
    """Writes a row per quantity that has truth, relit views and albedo after the headline's scale; a path ends in .png or
    .jpg. Raises OSError where the file cannot be written."""
    shown = spread(range(len(evaluated.dataset)), SHEET_VIEWS)
    kinds = ("truth", "prediction", f"error x{ERROR_GAIN}")
    heads = [f"{evaluated.dataset.frame_names[i]}: {kind}" for i in shown for kind in kinds]
    rows = []
    for label, pairs in _rows(shown, evaluated):
        errors = [np.clip(ERROR_GAIN * np.abs(prediction - truth), 0, 1) for truth, prediction in pairs]
        rows.append((label, [panel for pair, error in zip(pairs, errors) for panel in (*pair, error)]))
    write_image(path, picture_grid(heads, rows))


def picture_grid(heads: Sequence[str], rows: Sequence[tuple[str, Sequence[np.ndarray]]]) -> np.ndarray:
    """One picture [H, W, 3] in [0, 1] of many: a text above each column, and rows of a text and pictures [h, w, 3] of one
    size, sRGB in [0, 1]; small ones are enlarged."""
    height, width = rows[0][1][0].shape[:2]
    factor = -(-PANEL_WIDTH // width)
    width, height = width * factor, height * factor
    sheet = Image.new("RGB", (LABEL_WIDTH + len(heads) * width, LABEL_HEIGHT + len(rows) * height), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(size=12)
    for column, head in enumerate(heads):
        draw.text((LABEL_WIDTH + column * width + 4, 2), head, "black", font)
    for line, (label, pictures) in enumerate(rows):
        top = LABEL_HEIGHT + line * height
        draw.multiline_text((4, top + 4), label, "black", font)
        panels = Image.fromarray(to_uint8(np.concatenate(pictures, axis=1)))
        sheet.paste(panels.resize((len(pictures) * width, height), Image.Resampling.NEAREST), (LABEL_WIDTH, top))
    return np.asarray(sheet, np.float32) / 255


def _rows(shown: Sequence[int], evaluated: Evaluated) -> Iterator[Row]:
    dataset, predictions, truths = evaluated.dataset, evaluated.predictions, evaluated.truths
    scores, relit = evaluated.scores, evaluated.relit
    alphas = {i: dataset.images[i, ..., 3] for i in shown}
    if all("rgb" in predictions[i] for i in shown):
        yield (
            "novel view",
            [
                (over_background(dataset.images[i, ..., :3], alphas[i]), over_background(p["rgb"], p["alpha"]))
                for i, p in ((i, predictions[i]) for i in shown)
            ],
        )
    if relit is not None:
        scale = np.array(scores["relight"]["lsq"]["scale"])
        for name in relit.images:
            views = [relit.view(name, i) for i in shown]
            yield (
                f"relit by\n{name}",
                [(on_white(v.truth, v.truth_alpha), on_white(v.prediction, v.alpha, scale)) for v in views],
            )
    for key in ("albedo", "roughness", "metallic", "normal"):
        if all(getattr(truths[i], key) is not None and key in predictions[i] for i in shown):
            scale = np.array(scores["albedo"]["lsq"]["scale"]) if key == "albedo" else 1.0
            pairs = []
            for i in shown:
                alpha, truth_alpha = predictions[i]["alpha"], alphas[i]
                if key == "normal":  # where the truth is known, so that the rim shows no error that is not scored
                    alpha = truth_alpha = np.float32(truths[i].normal_mask)
                truth, prediction = getattr(truths[i], key), predictions[i][key]
                pairs.append((_shown(key, truth, truth_alpha), _shown(key, prediction, alpha, scale)))
            yield key, pairs


def _shown(key: str, values: np.ndarray, alpha: np.ndarray, scale: np.ndarray | float = 1.0) -> np.ndarray:
    """A map as an [H, W, 3] picture on white: colours sRGB, scalars grey, normals as n / 2 + 1 / 2."""
    if key == "albedo":
        return on_white(values, alpha, scale)
    if key == "normal":
        return over_background(0.5 * values + 0.5, alpha)
    return over_background(np.repeat(values[..., None], 3, axis=-1), alpha)
