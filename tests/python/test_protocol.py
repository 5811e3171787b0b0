"""What `evaluate_maps` compares with what: which pixels count, what stands behind them, which way errors are taken."""

from __future__ import annotations

import math

import numpy as np
import pytest
from splitnerf.data.dataset import Dataset
from splitnerf.data.images import linear_to_srgb
from splitnerf.data.truth import ViewTruth
from splitnerf.evaluate import metrics
from splitnerf.evaluate.protocol import evaluate_maps, image_scores, mean_scores

SIZE = 12
PREDICTED, TRUE = np.zeros((2, SIZE, SIZE), bool)
PREDICTED[2:], TRUE[:, 3:] = True, True  # rows and columns where there is an object
BOTH = PREDICTED & TRUE


def dataset(image: np.ndarray) -> Dataset:
    """One view [SIZE, SIZE, 4]."""
    eye, lens = np.eye(4, dtype=np.float32)[None], np.ones((1, 4), np.float32)
    return Dataset("one", None, "test", 1, np.float32(image)[None], eye, lens, ["a"], [], np.eye(4))


def picture(colour: object, alpha: object) -> np.ndarray:
    """[SIZE, SIZE, 4] of a colour and a coverage."""
    image = np.ones((SIZE, SIZE, 4), np.float32)
    image[..., :3] *= np.asarray(colour)
    image[..., 3] *= np.asarray(alpha)
    return image


def where(mask: np.ndarray, inside: object, outside: object) -> np.ndarray:
    return np.where(mask, np.float32(inside), np.float32(outside)).astype(np.float32)


def test_materials_are_compared_where_both_have_an_object():
    """Inside roughness is 0.1 too high in half of the columns and 0.3 too low in the others, outside all is wrong."""
    even = np.broadcast_to(np.arange(SIZE) % 2 == 0, (SIZE, SIZE))
    truth = ViewTruth("a", roughness=np.full((SIZE, SIZE), 0.5, np.float32), metallic=where(even, 1.0, 0.0))
    prediction = {
        "alpha": where(PREDICTED, 1.0, 0.5),
        "roughness": where(BOTH, np.where(even, 0.6, 0.2), 5.0),
        "metallic": where(BOTH, truth.metallic, 1 - truth.metallic),
    }
    scores = evaluate_maps([prediction], dataset(picture(0.5, where(TRUE, 1.0, 0.5))), [truth])
    share = (BOTH & even).sum() / BOTH.sum()
    assert scores["roughness_mae"] == pytest.approx(share * 0.1 + (1 - share) * 0.3, rel=1e-5)
    assert scores["metallic_balanced_accuracy"] == 1.0


def test_normals_are_compared_where_the_prediction_is_opaque_and_the_truth_has_some():
    """30 degrees off there and opposite elsewhere; the image's own coverage does not matter."""
    up = np.float32([0, 0, 1])
    tilted = np.float32([0, 0.5, math.sqrt(0.75)])
    truth = ViewTruth("a", normal=np.broadcast_to(up, (SIZE, SIZE, 3)), normal_mask=TRUE)
    prediction = {"alpha": where(PREDICTED, 1.0, 0.5), "normal": where(BOTH[..., None], tilted, -up)}
    scores = evaluate_maps([prediction], dataset(picture(0.5, 0.0)), [truth])
    assert scores["normal_mae_deg"] == pytest.approx(30.0, abs=1e-3)


def test_views_stand_on_white_once():
    """A photo of 0.2 that covers half of a pixel looks like 0.6 that covers all of it."""
    images = dataset(picture(0.2, 0.5))
    whole = {"rgb": picture(0.6, 1.0)[..., :3], "alpha": np.ones((SIZE, SIZE), np.float32)}
    assert evaluate_maps([whole], images, [ViewTruth("a")])["novel_view"]["psnr"] == pytest.approx(100.0, abs=1.0)


def test_albedos_stand_on_white_by_their_own_coverage():
    """Equal where both are opaque. Elsewhere linear 0.8 at 0.5 and 0.01 at 0.25, in sRGB over white."""
    edge = ~BOTH
    truth = ViewTruth("a", albedo=where(edge[..., None], [0.01] * 3, [0.3] * 3))
    prediction = {"alpha": where(edge, 0.5, 1.0), "albedo": where(edge[..., None], [0.8] * 3, [0.3] * 3)}
    scores = evaluate_maps([prediction], dataset(picture(0.5, where(edge, 0.25, 1.0))), [truth])["albedo"]
    bright, dark = linear_to_srgb(np.float32([0.8, 0.01]))
    off = (1 - 0.5 + 0.5 * bright) - (1 - 0.25 + 0.25 * dark)
    assert scores["lsq"]["scale"] == pytest.approx([1.0] * 3, rel=1e-5)
    assert scores["psnr"] == pytest.approx(-10 * math.log10(off**2 * edge.mean()), abs=1e-3)


def test_the_light_is_scaled_to_the_truth_and_judged_by_the_truths_white():
    light, truth = np.full((16, 32, 3), 0.7), np.full((16, 32, 3), 0.5)
    light[4:7, 8:12], truth[5:9, 20:22] = 9.0, 30.0
    found = evaluate_maps(
        [{"alpha": np.ones((SIZE, SIZE))}], dataset(picture(0.5, 1.0)), [ViewTruth("a")], light, truth
    )
    assert found["light_psnr"] == pytest.approx(metrics.light_psnr(light, truth))
    assert abs(found["light_psnr"] - metrics.light_psnr(truth, light)) > 0.5


def test_the_distance_is_asked_for_views_and_for_albedo():
    truth = ViewTruth("a", albedo=np.full((SIZE, SIZE, 3), 0.3, np.float32))
    prediction = {"rgb": picture(0.6, 1.0)[..., :3], "alpha": np.ones((SIZE, SIZE)), "albedo": truth.albedo}
    scores = evaluate_maps(
        [prediction],
        dataset(picture(0.5, 1.0)),
        [truth],
        distance=lambda image, truth: 0.25 + image.mean() - truth.mean(),
    )
    assert [scores[key]["lpips"] for key in ("novel_view", "albedo")] == pytest.approx([0.35, 0.25], abs=1e-5)


def test_a_prediction_is_clipped_before_it_is_scored():
    """What is brighter than white looks white."""
    assert image_scores(np.full((SIZE, SIZE, 3), 1.5), np.ones((SIZE, SIZE, 3)))["psnr"] == 100


def test_structure_is_compared_with_the_truths():
    image, truth = np.random.default_rng(0).random((2, 16, 16, 3))
    assert (
        image_scores(image, truth)["ssim"] == pytest.approx(metrics.ssim(image, truth))
        and metrics.ssim(image, truth) < 0.5
    )


def test_scores_of_views_are_averaged():
    scores = [{"psnr": x, "ssim": 0.1 * x, "lpips": 2 * x} for x in (1.0, 2.0, 6.0)]
    assert mean_scores(scores) == pytest.approx({"psnr": 3.0, "ssim": 0.3, "lpips": 6.0})
    assert mean_scores([{"psnr": 1.0, "ssim": 1.0, "lpips": None}])["lpips"] is None
