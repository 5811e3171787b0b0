"""Metrics against values worked out by hand, and what `evaluate_maps` compares with what."""

import json
import math

import numpy as np
import pytest
import trimesh
from splitnerf.data.dataset import Dataset
from splitnerf.data.environment import directions_of_texels, resize_environment
from splitnerf.data.images import linear_to_srgb
from splitnerf.data.truth import ViewTruth
from splitnerf.evaluate import metrics
from splitnerf.evaluate.protocol import evaluate_maps, image_scores, mean_scores


def test_psnr():
    # An error of 0.1 everywhere: MSE 0.01, 20 dB.
    assert metrics.psnr(np.full((4, 4, 3), 0.6), np.full((4, 4, 3), 0.5)) == pytest.approx(20)
    assert metrics.psnr(np.ones(3), np.ones(3)) == 100


def test_ssim_agrees_with_scikit_image():
    from skimage.metrics import structural_similarity

    rng = np.random.default_rng(0)
    x = rng.random((40, 30, 3))
    y = np.clip(x + rng.normal(0, 0.1, x.shape), 0, 1)
    expected = structural_similarity(
        x, y, channel_axis=-1, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1
    )
    assert metrics.ssim(x, y) == pytest.approx(expected, abs=1e-9)


def test_ssim_of_images_smaller_than_the_window():
    """The largest window that fits: 3 x 3 pixels of images whose columns are alike, so that one column's moments are all."""
    x, y, w = np.array([0.2, 0.5, 0.8]), np.array([0.1, 0.7, 0.3]), np.exp([-1 / 4.5, 0, -1 / 4.5])
    ((xx, xy), (_, yy)), (mx, my) = np.cov([x, y], aweights=w, ddof=0), np.average([x, y], axis=1, weights=w)
    expected = (2 * mx * my + 1e-4) / (mx**2 + my**2 + 1e-4) * (2 * xy + 9e-4) / (xx + yy + 9e-4)
    assert metrics.ssim(*(np.tile(z[:, None, None], (1, 7, 2)) for z in (x, y))) == pytest.approx(expected)


def test_scales():
    x = np.array([[1.0, 0], [2, 0], [3, 0]])
    y = np.array([[2.0, 1], [4, 1], [9, 1]])
    # sum xy / sum xx = (2 + 8 + 27) / 14; a black channel keeps 1.
    assert metrics.lsq_scale(metrics.lsq_sums(x, y)) == pytest.approx([37 / 14, 1])
    assert metrics.lsq_scale(metrics.lsq_sums(x, y, np.array([1.0, 0, 0]))) == pytest.approx([2, 1])


def test_normal_error():
    truth = np.array([[0.0, 0, 1], [0, 0, 1], [0, 0, 1]])
    normals = np.array([[0.0, 0, 1], [0, 1, 0], [0, 0, -1]])
    assert metrics.normal_mae_deg(normals, truth) == pytest.approx((0 + 90 + 180) / 3)


def test_balanced_accuracy():
    truth = np.array([1, 0, 0, 0, 0])
    # Recall 1 of metal, 3/4 of the rest; plain accuracy would be 4/5.
    assert metrics.balanced_accuracy(np.array([0.9, 0.9, 0.1, 0.1, 0.1]), truth) == pytest.approx(0.875)
    assert metrics.balanced_accuracy(np.array([0.1, 0.9]), np.array([0, 0])) == pytest.approx(0.5)
    # What is no more than the threshold is no metal.
    assert metrics.balanced_accuracy(np.array([0.5, 0.6]), np.array([0.5, 0.6])) == 1.0


def test_solid_angles_of_rows():
    # Two rows, hemispheres of equal size; four rows: (1 - cos 45) / 2 at the poles.
    of_rows = [directions_of_texels(n)[1].sum(axis=1) / (4 * np.pi) for n in (2, 4)]
    assert of_rows[0] == pytest.approx([0.5, 0.5])
    assert of_rows[1][0] == pytest.approx((1 - np.sqrt(0.5)) / 2)


def test_light_psnr_ignores_a_scale_per_channel_and_resolution():
    light = np.exp(np.random.default_rng(0).normal(0, 1, (128, 256, 3))).astype(np.float32)
    assert metrics.light_psnr(light * [0.5, 2, 7], light) == pytest.approx(100)
    assert metrics.light_psnr(np.repeat(np.repeat(light, 2, 0), 2, 1), light) == pytest.approx(100)
    # It sees single texels of 256 x 128: 0.5 and 1.5 in turn are scaled by 1 / 1.25, to 0.4 and to more than white.
    light[:] = 1 + 0.5 * (-1.0) ** np.indices((128, 256)).sum(axis=0)[..., None]
    assert metrics.light_psnr(light, np.ones_like(light)) == pytest.approx(-10 * np.log10(0.6**2 / 2), abs=1e-4)


def test_light_psnr_is_judged_up_to_the_99th_percentile_of_the_truth():
    """A lamp on less than a hundredth of the map counts as white, however bright; half of it is white as well."""
    weights = directions_of_texels(128)[1]
    truth, light = np.full((2, 128, 256, 3), 0.5)
    truth[66:70, :75] = light[66:70, :75] = 1.0  # white: 300 texels below the lamp's 160, of 32,768
    truth[60:64, :40], light[60:64, :40] = 3.0, 2.0
    light[:30] = 0.25
    light *= 0.8  # of no matter, as the scale is free
    scale = (weights * light[..., 0] * truth[..., 0]).sum() / (weights * light[..., 0] ** 2).sum()
    error = np.minimum(scale * light[..., 0], 1.0) - np.minimum(truth[..., 0], 1.0)
    expected = -10 * np.log10((weights * error**2).sum() / weights.sum())
    assert 1.25 < scale < 1.375 and metrics.light_psnr(light, truth) == pytest.approx(expected, abs=1e-4)
    scores = evaluate_maps([{"alpha": np.ones((SIZE, SIZE))}], dataset(picture(0.5, 1.0)), [ViewTruth()], light, truth)
    assert scores["light_psnr"] == pytest.approx(expected, abs=1e-4)


def test_resize_environment_wraps_around_and_keeps_constants():
    image = np.zeros((2, 4, 1), np.float32)
    image[:, 0] = 1
    wide = resize_environment(image, 2, 8)[0, :, 0]
    assert wide == pytest.approx([0.75, 0.75, 0.25, 0, 0, 0, 0, 0.25])
    blocks = np.arange(18.0).reshape(3, 6, 1) ** 2
    # (0+1+4 + 36+49+64 + 144+169+196) / 9 and (9+16+25 + 81+100+121 + 225+256+289) / 9.
    assert resize_environment(blocks, 1, 2)[0, :, 0] == pytest.approx([663 / 9, 1122 / 9])
    assert resize_environment(np.ones((5, 7, 3)), 4, 9) == pytest.approx(np.ones((4, 9, 3)))


def test_mesh_distances_go_both_ways():
    """A square and another one 10 above it against the first: half of the points are 10 off, and all of it is found.
    Shares are of a hundredth of the truth's diagonal, 0.014: what is 0.02 off is not found, however large the mesh."""
    square = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    square.apply_translation([5, 7, 3])  # of no matter
    above, beside = square.copy(), square.copy()
    above.apply_translation([0, 0, 10])
    beside.apply_translation([0, 0, 0.02])
    both = trimesh.util.concatenate([square, above])
    for mesh, truth in ((both, square), (square, both)):
        chamfer, f_score = metrics.mesh_distances(mesh, truth, 20_000)
        assert chamfer == pytest.approx(2.5, rel=0.03) and f_score == pytest.approx(2 / 3, abs=0.01)
    assert metrics.mesh_distances(trimesh.util.concatenate([beside, above]), square, 20_000)[1] == 0


def make_inputs():
    images = [picture(colours, TRUE) for colours in np.random.default_rng(0).random((2, SIZE, SIZE, 3))]
    truths, predictions = [], []
    for image in images:
        maps = {"albedo": 0.2 + 0.5 * image[..., :3], "roughness": image[..., 0], "metallic": where(BOTH, 1, 0)}
        maps["normal"] = np.broadcast_to(np.float32([0, 0, 1]), (SIZE, SIZE, 3))
        truths.append(ViewTruth(**maps, normal_mask=TRUE))
        predictions.append({"rgb": image[..., :3], "alpha": image[..., 3]} | maps)
    return predictions, dataset(*images), truths


KEYS = (
    "novel_view albedo relight normal_mae_deg roughness_mae metallic_balanced_accuracy light_psnr chamfer f_score seconds views"
).split()


def test_protocol_scores_the_truth_as_perfect():
    predictions, data, truths = make_inputs()
    light, box = np.ones((8, 16, 3)), trimesh.creation.box()
    result = evaluate_maps(predictions, data, truths, light, light, box, box, seconds=3.0)
    assert list(result) == KEYS
    assert result["novel_view"] == {"psnr": 100, "ssim": pytest.approx(1), "lpips": None}
    assert result["albedo"]["psnr"] == result["albedo"]["raw"]["psnr"] == 100
    assert [result[k] for k in ("normal_mae_deg", "roughness_mae", "chamfer")] == [0, 0, 0]
    assert (result["metallic_balanced_accuracy"], result["f_score"], result["light_psnr"]) == (1, 1, 100)
    json.dumps(result, allow_nan=False)


def test_protocol_is_null_without_truth():
    predictions, data, _ = make_inputs()
    result = evaluate_maps(predictions, data, [ViewTruth(), ViewTruth()], light=np.ones((8, 16, 3)))
    assert [key for key in KEYS if result[key] is not None] == ["novel_view", "views"]


# ---- what is compared ----


SIZE = 12
PREDICTED, TRUE = np.zeros((2, SIZE, SIZE), bool)
PREDICTED[2:], TRUE[:, 3:] = True, True  # rows and columns where there is an object
BOTH = PREDICTED & TRUE


def dataset(*images: np.ndarray) -> Dataset:
    """A view or two, [SIZE, SIZE, 4]."""
    eyes, lenses = np.stack([np.eye(4, dtype=np.float32) for _ in images]), np.ones((len(images), 4), np.float32)
    return Dataset("toy", None, "test", 1, np.float32(images), eyes, lenses, list("ab"[: len(images)]), [], np.eye(4))


def picture(colour: object, alpha: object) -> np.ndarray:
    """[SIZE, SIZE, 4] of a colour and a coverage."""
    parts = np.broadcast_to(colour, (SIZE, SIZE, 3)), np.broadcast_to(alpha, (SIZE, SIZE))
    return np.dstack(parts).astype(np.float32)


def where(mask: np.ndarray, inside: object, outside: object) -> np.ndarray:
    return np.where(mask, np.float32(inside), np.float32(outside)).astype(np.float32)


def test_materials_are_compared_where_both_have_an_object():
    """Inside roughness is 0.1 too high in half of the columns and 0.3 too low in the others, outside all is wrong."""
    even = np.broadcast_to(np.arange(SIZE) % 2 == 0, (SIZE, SIZE))
    truth = ViewTruth(roughness=np.full((SIZE, SIZE), 0.5, np.float32), metallic=where(even, 1.0, 0.0))
    prediction = {
        "alpha": where(PREDICTED, 0.91, 0.9),
        "roughness": where(BOTH, np.where(even, 0.6, 0.2), 5.0),
        "metallic": where(BOTH, truth.metallic, 1 - truth.metallic),
    }
    scores = evaluate_maps([prediction], dataset(picture(0.5, where(TRUE, 0.91, 0.9))), [truth])
    share = (BOTH & even).sum() / BOTH.sum()
    assert scores["roughness_mae"] == pytest.approx(share * 0.1 + (1 - share) * 0.3, rel=1e-5)
    assert scores["metallic_balanced_accuracy"] == 1.0


def test_normals_are_compared_where_the_prediction_is_opaque_and_the_truth_has_some():
    """30 degrees off there and opposite elsewhere; the image's own coverage does not matter."""
    up = np.float32([0, 0, 1])
    tilted = np.float32([0, 0.5, math.sqrt(0.75)])
    truth = ViewTruth(normal=np.broadcast_to(up, (SIZE, SIZE, 3)), normal_mask=TRUE)
    prediction = {"alpha": where(PREDICTED, 0.91, 0.9), "normal": where(BOTH[..., None], tilted, -up)}
    scores = evaluate_maps([prediction], dataset(picture(0.5, 0.0)), [truth])
    assert scores["normal_mae_deg"] == pytest.approx(30.0, abs=1e-3)


def test_views_stand_on_white_once():
    """A photo of 0.2 that covers half of a pixel looks like 0.6 that covers all of it, and what is brighter than white is white."""
    images = dataset(picture(0.2, 0.5))
    whole = {"rgb": picture(0.6, 1.0)[..., :3], "alpha": np.ones((SIZE, SIZE), np.float32)}
    assert evaluate_maps([whole], images, [ViewTruth()])["novel_view"]["psnr"] == pytest.approx(100.0, abs=1.0)
    assert image_scores(np.full((SIZE, SIZE, 3), 1.5), np.ones((SIZE, SIZE, 3)))["psnr"] == 100


def test_albedos_stand_on_white_by_their_own_coverage():
    """Equal where both are opaque. Elsewhere linear 0.8 at 0.5 and 0.01 at 0.25, in sRGB over white."""
    edge = ~BOTH
    truth = ViewTruth(albedo=where(edge[..., None], [0.01] * 3, [0.3] * 3))
    prediction = {"alpha": where(edge, 0.5, 1.0), "albedo": where(edge[..., None], [0.8] * 3, [0.3] * 3)}
    scores = evaluate_maps([prediction], dataset(picture(0.5, where(edge, 0.25, 1.0))), [truth])["albedo"]
    bright, dark = linear_to_srgb(np.float32([0.8, 0.01]))
    off = (1 - 0.5 + 0.5 * bright) - (1 - 0.25 + 0.25 * dark)
    assert scores["lsq"]["scale"] == pytest.approx([1.0] * 3, rel=1e-5)
    assert scores["psnr"] == pytest.approx(-10 * math.log10(off**2 * edge.mean()), abs=1e-3)


def test_the_distance_is_asked_for_views_and_for_albedo():
    truth = ViewTruth(albedo=np.full((SIZE, SIZE, 3), 0.3, np.float32))
    prediction = {"rgb": picture(0.6, 1.0)[..., :3], "alpha": np.ones((SIZE, SIZE)), "albedo": truth.albedo}
    distance = lambda image, truth: 0.25 + image.mean() - truth.mean()
    scores = evaluate_maps([prediction], dataset(picture(0.5, 1.0)), [truth], distance=distance)
    assert [scores[key]["lpips"] for key in ("novel_view", "albedo")] == pytest.approx([0.35, 0.25], abs=1e-5)


def test_scores_of_views_are_averaged():
    scores = [{"psnr": x, "ssim": 0.1 * x, "lpips": 2 * x} for x in (1.0, 2.0, 6.0)]
    assert mean_scores(scores) == pytest.approx({"psnr": 3.0, "ssim": 0.3, "lpips": 6.0})
    assert mean_scores([{"psnr": 1.0, "ssim": 1.0, "lpips": None}])["lpips"] is None
