"""Minutes of training: what the demo promises."""

from __future__ import annotations

import json

import pytest
from splitnerf.cli import DONE, main


@pytest.mark.slow
def test_the_demo_reaches_its_quality(tmp_path):
    run = tmp_path / "demo"
    assert main(["demo", "--out", str(run)]) == DONE
    result = json.loads((run / "evaluation.json").read_text())
    assert result["novel_view"]["psnr"] >= 28.0
    assert result["normal_mae_deg"] < 12.0
    assert result["albedo"]["lsq"]["psnr"] > 18.0
