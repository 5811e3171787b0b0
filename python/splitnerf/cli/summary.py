"""The printed summary of an evaluation."""

from __future__ import annotations

from pathlib import Path


def print_summary(
    run: Path, evaluation: dict, step: int | None = None, seconds: float | None = None, device: str = "cpu"
) -> None:
    """Prints the steps and the device, the errors against the truth in the data, and the path of the results."""
    if step is not None and seconds is not None:
        print(f"{step} steps in {seconds:.0f} s on the {'CPU' if device == 'cpu' else 'GPU'}")
    print_refinement(evaluation.get("refinement"))
    print_scores(evaluation)
    print(f"results: {run / 'report.html'}, {run / 'mesh.glb'}, {run / 'environment.exr'}")


def print_refinement(summary: dict | None) -> None:
    """A line with the changes by the refinement, if there was one."""
    if summary is None:
        return
    changes = ["colours {:.2f} -> {:.2f} dB".format(*summary["photos_psnr"])]
    if summary["outline_error"]:
        changes.append("coverage at the outline, squared error {:.2g} -> {:.2g}".format(*summary["outline_error"]))
    print(f"refinement, on the photos: {', '.join(changes)}, in {summary['steps']} steps, {summary['seconds']:.0f} s")


def print_scores(evaluation: dict) -> None:
    """A line for each score, after its free scale if it has one."""
    for name, key in (("novel views", "novel_view"), ("relit views", "relight"), ("albedo", "albedo")):
        scores = evaluation.get(key)
        if scores:
            lpips = "" if scores["lpips"] is None else f", LPIPS {scores['lpips']:.4f}"
            print(f"{name:22s} PSNR {scores['psnr']:.2f} dB, SSIM {scores['ssim']:.4f}{lpips}")
    for name, key, unit in (
        ("normals, mean angle", "normal_mae_deg", "degrees"),
        ("roughness, mean error", "roughness_mae", ""),
        ("metallic, bal. accuracy", "metallic_balanced_accuracy", ""),
        ("light PSNR", "light_psnr", "dB"),
        ("mesh chamfer", "chamfer", ""),
        ("mesh F-score", "f_score", ""),
    ):
        if evaluation.get(key) is not None:
            print(f"{name:22s} {evaluation[key]:.4g} {unit}".rstrip())
