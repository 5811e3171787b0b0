"""Writes the recovered light."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from splitnerf.data.images import write_image


def write_environment(run_dir: str | os.PathLike, radiance: np.ndarray) -> tuple[Path, Path]:
    """Writes `environment.exr` (half where the range allows, else float) and `environment.hdr`.

    Args:
        run_dir: The run's folder.
        radiance: [H, W, 3] linear radiance >= 0, equirectangular: u = 0.5 - atan2(y, x)/(2 pi), v = acos(z)/pi from
            the top.

    Returns:
        Both paths.

    Raises:
        ValueError: Wrong shape, or non-finite or negative radiance.
        OSError: A file cannot be written.
    """
    radiance = np.asarray(radiance, dtype=np.float32)
    if radiance.ndim != 3 or radiance.shape[2] != 3 or 0 in radiance.shape:
        raise ValueError(f"environment must be [H, W, 3], got {list(radiance.shape)}")
    if not np.isfinite(radiance).all() or radiance.min() < 0:
        raise ValueError("environment must be finite and not negative")
    exr, hdr = Path(run_dir) / "environment.exr", Path(run_dir) / "environment.hdr"
    write_image(exr, radiance, half=bool(radiance.max() <= np.finfo(np.float16).max))
    write_image(hdr, radiance)
    return exr, hdr
