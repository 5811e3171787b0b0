"""The report's section on the changes by the refinement."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from splitnerf.evaluate.metrics import psnr
from splitnerf_tools.report.pictures import data_uri
from splitnerf_tools.report.views import averaged, comparison

PICTURES = ("photo", "before", "after")
PAIRS = (("before", "after"), ("photo", "before"), ("photo", "after"))  # that the page compares


def refinement_section(page: Mapping) -> dict:
    """The contents of the section for the template.

    Args:
        page: `views`, each with `name`, `pictures` (photo, before and after, [H, W, 3] sRGB on white), and `coverage` (mean
            squared errors before and after); `summary`, the scores'
            part of the refinement; `lights`, linear maps [h, w, 3] before and after, are shown with the lights.
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
        "saturated": f"{100 * summary['saturated']:.1f} %",
    }
