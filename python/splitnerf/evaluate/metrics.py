"""Image, light, normal and mesh errors. Arrays are float, NumPy; colours and roughness in [0, 1]."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from splitnerf.data.environment import directions_of_texels, resize_environment

MSE_FLOOR = 1e-10
LIGHT_SIZE = (128, 256)
MESH_SAMPLES = 100_000
F_SCORE_SHARE = 0.01


def psnr(prediction: np.ndarray, truth: np.ndarray) -> float:
    """-10 log10(MSE) in dB of arrays of one shape, data range 1; equal ones give 100 dB."""
    mse = np.mean((np.asarray(prediction, np.float64) - truth) ** 2)
    return float(-10 * np.log10(max(mse, MSE_FLOOR)))


def ssim(prediction: np.ndarray, truth: np.ndarray) -> float:
    """Structural similarity of images [H, W, C], at most 1: 11 x 11 Gaussian window of sigma 1.5, data range 1, mean over full
    windows and channels. Images smaller than the window are compared with the largest window that fits. Source: Wang et al., Image
    quality assessment: from error visibility to structural similarity, 2004."""
    x, y = np.asarray(prediction, np.float64), np.asarray(truth, np.float64)
    radius = min(5, (min(x.shape[:2]) - 1) // 2)

    def mean(image: np.ndarray) -> np.ndarray:
        inside = slice(radius, -radius or None)
        return gaussian_filter(image, 1.5, axes=(0, 1), radius=radius)[inside, inside]

    mean_x, mean_y = mean(x), mean(y)
    var_x, var_y = mean(x * x) - mean_x**2, mean(y * y) - mean_y**2
    covariance = mean(x * y) - mean_x * mean_y
    c1, c2 = 0.01**2, 0.03**2
    luminance = (2 * mean_x * mean_y + c1) / (mean_x**2 + mean_y**2 + c1)
    structure = (2 * covariance + c2) / (var_x + var_y + c2)
    return float((luminance * structure).mean())


def lsq_sums(prediction: np.ndarray, truth: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
    """The sums [2, C] float64 (sum w x y, sum w x^2) of linear pixels [m, C] with weights [m], 1 by default, for
    `lsq_scale`; sums of parts can be added."""
    x, y = np.asarray(prediction, np.float64), np.asarray(truth, np.float64)
    w = np.ones(len(x)) if weights is None else weights
    return np.stack([(w[:, None] * x * y).sum(axis=0), (w[:, None] * x * x).sum(axis=0)])


def lsq_scale(sums: np.ndarray) -> np.ndarray:
    """The factor per channel [C] float64 that brings a prediction nearest to the truth, sum w x y / sum w x^2 of
    `lsq_sums`; 1 for a channel that is 0 everywhere."""
    product, square = sums
    return np.where(square > 0, product / np.where(square > 0, square, 1), 1.0)


def normal_mae_deg(prediction: np.ndarray, truth: np.ndarray) -> float:
    """Mean angle in degrees between unit normals [m, 3]: 2 atan2(|a - b|, |a + b|), stable near 0 and 180."""
    a, b = np.asarray(prediction, np.float64), np.asarray(truth, np.float64)
    angles = 2 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    return float(np.degrees(angles).mean())


def balanced_accuracy(prediction: np.ndarray, truth: np.ndarray) -> float:
    """Mean recall over the classes (above 0.5: metal; not metal) that the truth [m] in [0, 1] has."""
    predicted, actual = np.asarray(prediction) > 0.5, np.asarray(truth) > 0.5
    return float(np.mean([(predicted == actual)[actual == c].mean() for c in (False, True) if (actual == c).any()]))


def light_psnr(light: np.ndarray, truth: np.ndarray) -> float:
    """PSNR in dB, at most 100, of an environment map [H, W, 3] after removing the scale that albedo and light share: both maps are
    brought to 256 x 128, the prediction is scaled per channel by least squares, both are divided by the truth's 99th percentile and
    clipped to [0, 1]; pixels weigh by their solid angle."""
    x, y = (resize_environment(image, *LIGHT_SIZE).reshape(-1, 3).astype(np.float64) for image in (light, truth))
    weights = directions_of_texels(LIGHT_SIZE[0])[1].ravel()
    white = max(np.percentile(y, 99), 1e-8)
    x, y = (np.clip(image / white, 0, 1) for image in (x * lsq_scale(lsq_sums(x, y, weights)), y))
    mse = np.average(((x - y) ** 2).mean(axis=1), weights=weights)
    return float(-10 * np.log10(max(mse, MSE_FLOOR)))


def mesh_distances(mesh: trimesh.Trimesh, truth: trimesh.Trimesh, samples: int = MESH_SAMPLES) -> tuple[float, float]:
    """Chamfer distance and F-score between two surfaces in one frame, by `samples` points spread over each: the mean of both
    directions' mean nearest distance, in units of the meshes, and the harmonic mean of the shares of points that lie within 1 % of
    the diagonal of the truth's bounding box, in [0, 1]."""
    points, targets = (np.asarray(trimesh.sample.sample_surface(m, samples, seed=0)[0]) for m in (mesh, truth))
    to_truth, _ = cKDTree(targets).query(points)
    to_mesh, _ = cKDTree(points).query(targets)
    threshold = F_SCORE_SHARE * np.linalg.norm(np.ptp(truth.bounds, axis=0))
    precision, recall = (to_truth < threshold).mean(), (to_mesh < threshold).mean()
    f_score = 2 * precision * recall / max(precision + recall, 1e-12)
    return float((to_truth.mean() + to_mesh.mean()) / 2), float(f_score)
