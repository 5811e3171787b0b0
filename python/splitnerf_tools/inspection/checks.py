"""What a data set holds, one line a finding, and what may be wrong with it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from splitnerf.data.dataset import Dataset
from splitnerf.data.frames import layout_of, split_rule
from splitnerf.data.images import srgb_to_linear
from splitnerf.data.reading import Reading
from splitnerf.errors import InputError

from splitnerf_tools.findings import Finding
from splitnerf_tools.inspection.hull import Fit, fit_masks
from splitnerf_tools.inspection.reduced_views import ReducedView, views_of

WIDEST_GAP = 120.0  # degrees of azimuth without a camera
SMALLEST_SHARE, LARGEST_CUT, LARGEST_CLIPPED = 0.05, 0.01, 0.05  # of the photo, of its edge, of the object
ROUGH = 0.75  # median agreement of masks and poses from which on they fit
ENOUGH = 8  # photos whose hull is near enough to the object for that
UNEVEN, OUTLIER, OUTLIER_DEVIATIONS = 0.1, 0.3, 6.0  # powers of two between neighbours: of most, of one
NAMED = 3  # photos in a line


@dataclass
class Inspection:
    """All that was found.

    Attributes:
        title: The data's name.
        views: The photos, those to train on first.
        fit: The object's hull, and how the masks fit it.
        upward: [3] unit vector.
        brightness: [n] differences from photos nearby, powers of two; NaN where there is none.
        findings: The lines.
    """

    title: str
    views: list[ReducedView]
    fit: Fit
    upward: np.ndarray
    brightness: np.ndarray
    findings: list[Finding]


def inspect(train: Dataset, test: Dataset | None, reading: Reading) -> Inspection:
    """Looks at a data set, with or without photos held out. Raises InputError where the masks and poses leave no hull."""
    views = views_of(train) + ([] if test is None else views_of(test))
    fit = fit_masks(views)
    if fit is None:
        raise InputError(f"{train.root}: no part of space lies in most of the masks; check the poses and masks")
    azimuth, elevation, upward = angles(views, fit.centre)
    brightness = differences(views, fit)
    findings = [
        _layout(train, test, reading),
        _sizes(train, test),
        _distances(views, fit, train.box_from_world),
        _directions(azimuth, elevation),
        _upward(upward),
        _inside(views, fit),
        _shares(views),
        _cut(views),
        _agreement(views, fit),
        _duplicates(views, fit),
        _brightness(views, brightness),
        _clipped(views),
    ]
    return Inspection(train.name, views, fit, upward, brightness, findings)


def _layout(train: Dataset, test: Dataset | None, reading: Reading) -> Finding:
    layout = layout_of(train.root).__name__.split(".")[-1].replace("_", " ")
    held_out = 0 if test is None else len(test)
    split = f"{len(train)} photos to train on, {held_out} held out ({split_rule(train.root, reading)})"
    return Finding("layout", f"{layout}; {split}")


def _sizes(train: Dataset, test: Dataset | None) -> Finding:
    splits = [split for split in (train, test) if split is not None]
    sizes = {f"{width} x {height}" for split in splits for height, width in split.sizes.tolist()}
    across = np.degrees(2 * np.arctan(0.5 * train.sizes[:, 1] / train.intrinsics[:, 0]))
    reduced = f", averaged down by {train.downscale}" if train.downscale > 1 else ""
    return Finding("size", f"{' and '.join(sorted(sizes))} pixels{reduced}, {_range(across, '.0f')} degrees across")


def _distances(views: Sequence[ReducedView], fit: Fit, box_from_world: np.ndarray) -> Finding:
    radii = np.linalg.norm([view.place - fit.centre for view in views], axis=1) / fit.radius
    unit = fit.radius / np.cbrt(np.linalg.det(box_from_world[:3, :3]))
    value = f"{_range(radii, '.3g')} radii of the object; one is {unit:.3g} of the data's units"
    return Finding("distance of cameras", value)


def _directions(azimuth: np.ndarray, elevation: np.ndarray) -> Finding:
    gap, begin = largest_gap(azimuth, elevation)
    value = f"largest gap {gap:.0f} degrees around; {_range(elevation, '.0f')} degrees above the horizon"
    advice = ""
    if gap > WIDEST_GAP:
        sector = f"{begin:.0f} to {(begin + gap + 180) % 360 - 180:.0f} degrees"
        advice = f"no photo shows the side from azimuth {sector}, so it will be guessed: add photos from there"
    return Finding("directions", value, advice)


def _upward(upward: np.ndarray) -> Finding:
    value, advice = "z" if upward[2] == 1 else "({:.2f}, {:.2f}, {:.2f})".format(*upward + 0.0), ""
    if upward[2] < 1:
        advice = "the results stand as the data do, and other programs take their z for upward: turn the data's world"
    return Finding("upward by the cameras", value, advice)


def _inside(views: Sequence[ReducedView], fit: Fit) -> Finding:
    suspects = dict.fromkeys(fit.inside, "camera in the object")
    return _suspicion(
        "cameras in the object", f"{len(suspects) or 'none'}", "check their poses, or leave them out", views, suspects
    )


def _shares(views: Sequence[ReducedView]) -> Finding:
    shares = np.array([view.share for view in views])
    suspects = _worst(-shares, -SMALLEST_SHARE, shares, "object on {:.1%}")
    advice = f"the object is small in {len(suspects)}, go nearer or cut them out"
    return _suspicion("masks cover", f"{_range(100 * shares, '.1f')} % of the photo", advice, views, suspects)


def _cut(views: Sequence[ReducedView]) -> Finding:
    shares = np.array([view.cut for view in views])
    suspects = _worst(shares, LARGEST_CUT, shares, "cut, {:.0%} of the edge")
    advice = "keep the whole object in most photos, go farther away"
    return _suspicion("cut by the edge", f"{len(suspects) or 'none'}", advice, views, suspects)


def _agreement(views: Sequence[ReducedView], fit: Fit) -> Finding:
    suspects = {i: f"mask fits {fit.agreement[i]:.2f}" for i in fit.outliers}
    advice = ""
    if suspects:
        advice = f"look at the masks and poses of {_named(views, suspects)}; the object may have moved"
    elif len(views) >= ENOUGH and np.median(fit.agreement) < ROUGH:
        advice = "masks and poses fit badly everywhere: are the poses, the lens and the masks those of these photos?"
    value = f"intersection over union with the others' hull {_range(fit.agreement, '.2f')}"
    return Finding("masks against poses", f"{value}, {len(suspects) or 'no'} outliers", advice, suspects=suspects)


def _duplicates(views: Sequence[ReducedView], fit: Fit) -> Finding:
    pairs = duplicates(views, fit.radius)
    suspects: dict[int, str] = {}
    for i, j, what in pairs:
        suspects.setdefault(i, f"{what}: {views[j].name}")
        suspects.setdefault(j, f"{what}: {views[i].name}")
    kinds = sorted({what for _, _, what in pairs})
    value = ", ".join(f"{sum(pair[2] == kind for pair in pairs)} pairs, {kind}" for kind in kinds) or "none"
    listed = [f"{views[i].name} and {views[j].name}" for i, j, _ in pairs]
    advice = f"keep one, or check the poses: {_some(listed)}" if pairs else ""
    return Finding("duplicate photos", value, advice, suspects=suspects)


def _brightness(views: Sequence[ReducedView], brightness: np.ndarray) -> Finding:
    exposures = np.array([view.exposure for view in views])
    stated = np.ptp(exposures) > 0
    value = f"exposures stated, {_range(exposures, '.2f')}" if stated else "no exposures stated"
    known = np.abs(brightness[np.isfinite(brightness)])
    if len(known) == 0:
        return Finding("brightness", f"{value}; no two photos are near enough to compare")
    usual = 1.4826 * float(np.median(known))
    sizes, least = np.abs(np.nan_to_num(brightness)), max(OUTLIER, OUTLIER_DEVIATIONS * usual)
    suspects = _worst(sizes, least, brightness, "brightness {:+.2f} EV")
    value += f"; photos differ from those beside them by {usual:.2g} EV, at most {known.max():.2g}"
    advice = ""
    if usual > UNEVEN:
        wrong = "the stated exposures do not make them alike" if stated else "they were not exposed alike"
        advice = f"the object shines, or {wrong}: give `exposure` in each frame, or use `splitnerf prepare`"
    elif suspects:
        advice = f"exposed otherwise, or the light changed: {_named(views, suspects)}"
    return Finding("brightness", value, advice, suspects=suspects)


def _clipped(views: Sequence[ReducedView]) -> Finding:
    shares = np.array([view.clipped for view in views])
    suspects = _worst(shares, LARGEST_CLIPPED, shares, "clipped {:.0%}")
    value = f"{_range(100 * shares, '.1f')} % of the object's pixels"
    return _suspicion("clipped", value, "expose less, what is clipped has no colour", views, suspects)


def _worst(sizes: np.ndarray, least: float, values: np.ndarray, words: str) -> dict[int, str]:
    """The photos whose size is above the least one, the largest first, with their values in words."""
    return {int(i): words.format(values[i]) for i in np.argsort(-sizes) if sizes[i] > least}


def _suspicion(name: str, value: str, advice: str, views: Sequence[ReducedView], suspects: dict[int, str]) -> Finding:
    """A finding whose advice, if photos are suspected, ends with their names."""
    return Finding(name, value, f"{advice}: {_named(views, suspects)}" if suspects else "", suspects=suspects)


def _range(values: np.ndarray, form: str) -> str:
    """The least and the greatest of values and their median, in words."""
    low, middle, high = (f"{np.quantile(values, q):{form}}" for q in (0, 0.5, 1))
    return low if low == high else f"{low} to {high} (median {middle})"


def _named(views: Sequence[ReducedView], suspects: Iterable[int]) -> str:
    return _some([views[i].name for i in suspects])


def _some(names: Sequence[str]) -> str:
    """The first of some names, and how many there are more."""
    rest = len(names) - NAMED
    return ", ".join(names[:NAMED]) + (f" and {rest} more" if rest > 0 else "")


# ---- from which sides the cameras see the object ----

LEVEL = 0.1  # mean square of the sideways axes along upward, beyond which cameras are rolled and do not tell upward
POLE = 75.0  # degrees of elevation, up or down, from which on a camera is on no side
NEAR_AXIS = 10.0  # degrees between upward and the data's z axis that count as none


def angles(views: Sequence[ReducedView], centre: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Azimuths [n] in (-180, 180] and elevations [n] of the cameras seen from a point [3], degrees, and upward [3]."""
    upward = find_upward(np.stack([view.pose for view in views]))
    x, y = horizontal_axes(upward)
    away = np.stack([view.place - centre for view in views])
    azimuth = np.degrees(np.arctan2(away @ y, away @ x))
    return azimuth, np.degrees(np.arctan2(away @ upward, np.hypot(away @ x, away @ y))), upward


def find_upward(poses: np.ndarray) -> np.ndarray:
    """[3] the upward unit vector perpendicular to the x axes of OpenGL poses [n, 4, 4]; z where it is nearly z or there is none."""
    z = np.array([0.0, 0.0, 1.0])
    sideways = poses[:, :3, 0]
    if (sideways @ z).std() == 0 and np.abs(sideways @ z).max() < 1e-6:
        return z if poses[:, 2, 1].mean() >= 0 else -z
    values, vectors = np.linalg.eigh(sideways.T @ sideways / len(poses))
    upward = vectors[:, 0] * (1 if poses[:, :3, 1].mean(0) @ vectors[:, 0] >= 0 else -1)
    return z if values[0] > LEVEL or upward @ z > np.cos(np.radians(NEAR_AXIS)) else upward


def horizontal_axes(upward: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors that make a right-handed frame with upward; x and y where that is z."""
    x = np.array([1.0, 0.0, 0.0]) if abs(upward[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = x - (x @ upward) * upward
    x /= np.linalg.norm(x)
    return x, np.cross(upward, x)


def largest_gap(azimuth: np.ndarray, elevation: np.ndarray) -> tuple[float, float]:
    """The widest range of azimuths without a camera, and where it begins, degrees; cameras at the poles do not count."""
    sorted_azimuths = np.sort(azimuth[np.abs(elevation) < POLE])
    if len(sorted_azimuths) == 0:
        return 360.0, -180.0
    gaps = np.diff(np.append(sorted_azimuths, sorted_azimuths[0] + 360))
    return float(gaps.max()), float(sorted_azimuths[gaps.argmax()])


# ---- photos in pairs: those that are there twice, and how bright each is beside those from nearby ----

SAME_ANGLE, SAME_PLACE = 0.05, 1e-3  # degrees and object's radii by which one pose differs
COPIES, OTHER_POSES, ONE_POSE = "one photo twice", "one photo, two poses", "two photos, one pose"
NEIGHBOURS, NEAR = 4, 40.0  # photos that one is compared with, and degrees between their directions at most
LEAST_SHARED = 20  # cells that two photos must both show
BEHIND = 2.0  # cells by which a cell may lie behind the first in its pixel and be seen
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
DARKEST = 1e-3  # of the linear values that count


def duplicates(views: Sequence[ReducedView], radius: float) -> list[tuple[int, int, str]]:
    """Pairs of photos, i < j, of which at most one can be right, and what they are: one file, or one pose."""
    poses = np.stack([view.pose for view in views])
    apart = np.linalg.norm(poses[:, None, :3, 3] - poses[None, :, :3, 3], axis=-1) / radius
    turn = (np.einsum("iab,jab->ij", poses[:, :3, :3], poses[:, :3, :3]) - 1) / 2
    one_pose = (apart < SAME_PLACE) & (np.degrees(np.arccos(np.clip(turn, -1, 1))) < SAME_ANGLE)
    files = np.array([hashlib.sha256(view.path.read_bytes()).hexdigest() for view in views])
    one_file = files[:, None] == files
    kinds = {(True, True): COPIES, (True, False): OTHER_POSES, (False, True): ONE_POSE}
    pairs = np.argwhere(np.triu(one_file | one_pose, 1)).tolist()
    return [(i, j, kinds[bool(one_file[i, j]), bool(one_pose[i, j])]) for i, j in pairs]


def differences(views: Sequence[ReducedView], fit: Fit) -> np.ndarray:
    """[n] by how many powers of two each photo is brighter than its neighbours in direction, by the medians over the cells of the
    hull's surface that both show, and over the neighbours; NaN where it has none."""
    surface = _surface(fit)
    values = np.stack([_seen_values(view, surface, fit.cell) for view in views])
    directions = np.stack([view.place - fit.centre for view in views])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    cosines = directions @ directions.T
    np.fill_diagonal(cosines, -2)
    result = np.full(len(views), np.nan)
    for i, row in enumerate(cosines):
        ratios = [values[i] - values[j] for j in np.argsort(-row)[:NEIGHBOURS] if row[j] > np.cos(np.radians(NEAR))]
        medians = [np.nanmedian(ratio) for ratio in ratios if np.isfinite(ratio).sum() >= LEAST_SHARED]
        if medians:
            result[i] = np.median(medians)
    return result


def _surface(fit: Fit) -> np.ndarray:
    """[m, 3] the cells of the hull that have fewer than six neighbours."""
    tree = cKDTree(fit.cells)
    return fit.cells[tree.query_ball_point(fit.cells, 1.1 * fit.cell, return_length=True) < 7]


def _seen_values(view: ReducedView, cells: np.ndarray, cell: float) -> np.ndarray:
    """[m] the logarithm, base 2, of the luminance at which a view shows cells; NaN where it does not."""
    values = np.full(len(cells), np.nan)
    numbers, y, x, depth = view.shown(cells, cell)
    step = max(1, round(1.5 * view.intrinsics[0] * cell / float(np.median(depth)))) if len(numbers) else 1
    height, width = view.mask.shape
    first = np.full((height // step + 1, width // step + 1), np.inf)
    np.minimum.at(first, (y // step, x // step), depth)
    visible = (depth <= first[y // step, x // step] + BEHIND * cell) & view.mask[y, x]
    luminance = srgb_to_linear(view.colour[y[visible], x[visible]]) @ LUMINANCE
    values[numbers[visible]] = np.where(luminance > DARKEST, np.log2(np.maximum(luminance, DARKEST)), np.nan)
    return values
