"""The bench of shading under truth runs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_spheres_under_a_sun_are_compared():
    command = [sys.executable, "tests/bench/shading_truth.py", "spheres:sun", "--views", "1", "--size", "24", "--spp", "8"]
    command += ["--spacing", "0.2"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert "spheres" in done.stdout
