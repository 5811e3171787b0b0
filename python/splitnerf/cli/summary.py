"""What a command prints of an evaluation."""

from __future__ import annotations

from pathlib import Path


def print_summary(run: Path, evaluation: dict, step: int | None = None, seconds: float | None = None) -> None:
    """The errors against whatever truth the data hold, and where the results lie."""
    if step is not None and seconds is not None:
        print(f"{step} steps in {seconds:.0f} s")
    rows = [("novel views", evaluation["novel_view"], "dB"), ("albedo", evaluation["albedo"], "dB")]
    for name, part, unit in rows:
        if part:
            scores = part.get("lsq", part)
            print(f"{name:22s} PSNR {scores['psnr']:.2f} {unit}, SSIM {scores['ssim']:.4f}")
    for name, key, unit in (
        ("normals, mean angle", "normal_mae_deg", "degrees"), ("roughness, mean error", "roughness_mae", ""),
        ("metallic, bal. accuracy", "metallic_balanced_accuracy", ""), ("light PSNR", "light_psnr", "dB"),
        ("mesh chamfer", "chamfer", ""), ("mesh F-score", "f_score", ""),
    ):  # fmt: skip
        if evaluation.get(key) is not None:
            print(f"{name:22s} {evaluation[key]:.4g} {unit}".rstrip())
    print(f"results: {run / 'report.html'}, {run / 'mesh.glb'}, {run / 'environment.exr'}")
