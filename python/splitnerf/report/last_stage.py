"""The report's section on the last stage: what it changed, and what the photos leave open."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from splitnerf.data.images import over_background
from splitnerf.evaluate.metrics import psnr
from splitnerf.refinement.uncertainty import UNKNOWN
from splitnerf.report.pictures import data_uri
from splitnerf.report.views import averaged, comparison

PICTURES = ("photo", "before", "after")
PAIRS = (("before", "after"), ("photo", "before"), ("photo", "after"))  # that the page compares
QUANTITIES = ("albedo", "roughness", "metallic", "normal")
# Colours of deviations from 0 to UNKNOWN, and beyond it.
KNOWN_COLOURS = np.float32([[0.10, 0.18, 0.38], [0.16, 0.48, 0.62], [0.55, 0.78, 0.55], [0.98, 0.88, 0.42]])
UNKNOWN_COLOURS = np.float32([[0.82, 0.10, 0.42], [0.62, 0.05, 0.32]])
STRIPE = 3  # pixels


def last_stage_section(page: Mapping) -> dict:
    """The contents of the section for the template.

    Args:
        page: `views`, each with `name`, `pictures` (photo, before and after, [H, W, 3] sRGB on white), `coverage` (mean
            squared errors before and after) and `uncertain` (deviations [H, W, 4] and coverage [H, W]); `summary`, the scores'
            part of the last stage; `lights`, linear maps [h, w, 3] before and after, are shown with the lights.
    """
    views, summary, rows = page["views"], page["summary"], []
    scores = np.array([[psnr(view["pictures"][i], view["pictures"][0]) for i in (1, 2)] for view in views])
    for view, (before, after) in zip(views, scores):
        rows.append((f"{view['name']}: colours, PSNR on white", f"{before:.2f} dB", f"{after:.2f} dB"))
    rows.append(("these views: colours, mean PSNR", *(f"{value:.2f} dB" for value in scores.mean(0))))
    coverage = np.mean([view["coverage"] for view in views], axis=0)
    rows.append(("these views: coverage, mean squared error", *(f"{value:.2g}" for value in coverage)))
    if summary["outline_error"]:
        rows.append(("all photos: coverage at the outline, mean squared error", *(f"{v:.2g}" for v in summary["outline_error"])))
    name = "all photos: colours inside the outline, PSNR before the first step and before the last one"
    rows.append((name, *(f"{v:.2f} dB" for v in summary["photos_psnr"])))
    return {
        "pictures": PICTURES,
        "pairs": [comparison(*pair, "colour") | {"name": " | ".join(pair), "sides": pair} for pair in PAIRS],
        "views": [
            {"name": view["name"], "score": "{:.2f} → {:.2f} dB".format(*score), "cells": [data_uri(averaged(p)[0]) for p in view["pictures"]]}
            for view, score in zip(views, scores)
        ],
        "rows": rows,
        "steps": summary["steps"],
        "seconds": f"{summary['seconds']:.0f}",
        "quantities": [
            {"name": name, "limit": _limit(name, limit), "unknown": f"{100 * share:.0f} %"}
            for name, limit, share in zip(QUANTITIES, UNKNOWN.tolist(), _unknown_shares(views))
        ],
        "uncertain": [
            {"name": view["name"], "cells": [data_uri(coloured(smaller, i)) for i in range(len(QUANTITIES))]}
            for view, smaller in ((view, averaged(*view["uncertain"])) for view in views)
        ],
        "legend": data_uri(_legend()),
        "saturated": f"{100 * summary['saturated']:.1f} %",
        "deviation": f"{summary['deviation']:.3f}",
    }


def coloured(uncertain: tuple[np.ndarray, np.ndarray], quantity: int) -> np.ndarray:
    """A picture [H, W, 3] of one of the four deviations: a scale from dark to bright, and stripes where it is unknown."""
    values, alpha = uncertain
    share = values[..., quantity] / float(UNKNOWN[quantity])
    rows, columns = np.indices(share.shape)
    stripes = UNKNOWN_COLOURS[(rows + columns) // STRIPE % 2]
    return over_background(np.where(share[..., None] > 1.0, stripes, _scale(share)), alpha)


def _scale(share: np.ndarray) -> np.ndarray:
    """[..., 3] the colours of deviations as shares [...] of the largest one that is not unknown."""
    nodes = np.linspace(0, 1, len(KNOWN_COLOURS))
    return np.stack([np.interp(share, nodes, KNOWN_COLOURS[:, c]) for c in range(3)], axis=-1).astype(np.float32)


def _legend() -> np.ndarray:
    """The scale from 0 to the threshold, then the stripes."""
    share = np.tile(np.linspace(0, 1.25, 200, dtype=np.float32), (12, 1))
    values = np.repeat((share * float(UNKNOWN[0]))[..., None], 4, axis=2)
    return coloured((values, np.ones_like(share)), 0)


def _limit(name: str, limit: float) -> str:
    return f"{math.degrees(limit):.0f}°" if name == "normal" else f"{limit:.2f}"


def _unknown_shares(views: Sequence[Mapping]) -> np.ndarray:
    """[4] the share of the views' covered pixels at which each quantity is unknown."""
    values = np.concatenate([values[alpha > 0.9] for values, alpha in (view["uncertain"] for view in views)])
    return (values > UNKNOWN.numpy()).mean(0) if len(values) else np.zeros(len(UNKNOWN))
