"""Camera poses of photographs by structure from motion (COLMAP, through pycolmap)."""

from __future__ import annotations

import re
import shutil
import sqlite3
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from statistics import median
from urllib.parse import quote, unquote

import numpy as np
import pycolmap
from splitnerf.data.layouts.frame import OPENCV_AXES
from splitnerf.errors import InputError, note

from splitnerf_tools.capture.photographs import Photograph

LONGEST = 2000  # edge in pixels of the photos in which features are looked for: 16 megapixels take 7 s each
MOST_FEATURES = 4096  # of a photo: more take longer in all that follows
TILE = 8  # photos along the edge of a tile of pairs
BLOCK = 64  # pairs of photos whose matches are written at once, so that the progress moves
EXHAUSTIVE = 250  # photos up to which each is matched with each other one
OVERLAP = 15  # neighbours in the order of names with which a photo is matched beyond that, and those 2^k further
COUNT = """
import contextlib, sqlite3, sys, time
while True:
    with contextlib.suppress(sqlite3.Error), sqlite3.connect(f"file:{sys.argv[1]}?mode=ro", uri=True, timeout=0.1) as base:
        print(base.execute(f"SELECT COUNT(*) FROM {sys.argv[2]}").fetchone()[0], flush=True)
    time.sleep(1)
"""  # prints a number a second
MIN_PHOTOS = 3
LEAST_DETAIL = 30  # features of a photo, on average, with which it could fit to others
FEW = 10  # photos up to which points that two of them show are kept
ITERATIONS = 20  # of each adjustment: 15 and 30 give the same cameras; 100 took minutes
# Pixels of reprojection and photos of a point beyond and below which the adjustment drops it.
MAX_ERROR, SHORTEST = 2.0, 3
LEAST_SEEN = 15  # points that a photo shows, with fewer of which its camera is not believed
OUTLIER = 0.5  # pixels of reprojection from which on an observation counts less
ADJUSTMENTS = 3
FOCAL_RANGE = 0.3, 6.0  # focal lengths that are believed, in lengths of the photo's longer edge
ONE_LENS, UNSURE = 0.03, 0.1  # most differences of focal lengths of one lens, as a share, see `_alike`
OF_A_LENS = 20  # observations by which a further lens must be worth it
# Pixels of reprojection, those of few photos, and share of photos without a camera, from which on all cameras are doubted.
SURE, SURE_OF_FEW, LOST = 0.4, 0.3, 0.05
TRIES = 2  # to find better ones
GROUPINGS = 4  # of photos by lenses, at most, until the focal lengths that their points show agree with them
CENTRAL = 0.1  # distance of a principal point from the photo's middle that is believed, in the photo's width and height


@dataclass
class Lens:
    """A camera's projection in OpenCV's model.

    Attributes:
        width, height: The size of the photos in pixels.
        fx, fy, cx, cy: Focal lengths and principal point in pixels; pixel centres at +0.5.
        k1, k2, p1, p2: Radial and tangential distortion.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    k1: float
    k2: float
    p1: float
    p2: float

    @property
    def matrix(self) -> np.ndarray:
        """[3, 3] float64."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])

    @property
    def distortion(self) -> np.ndarray:
        """[4] float64, k1 k2 p1 p2."""
        return np.array([self.k1, self.k2, self.p1, self.p2])

    def resized(self, width: int, height: int) -> Lens:
        """The same lens on photos of another size."""
        x, y = width / self.width, height / self.height
        return replace(self, width=width, height=height, fx=self.fx * x, fy=self.fy * y, cx=self.cx * x, cy=self.cy * y)


@dataclass
class Reconstruction:
    """What structure from motion finds.

    Attributes:
        names: Names of the n registered photos.
        poses: [n, 4, 4] float64 camera-to-world, OpenGL axes.
        lenses: The lens of each registered photo.
        points: [m, 3] float64 sparse points.
        photo_of, point_of: [k] int64, the photo and the point of each observation.
        observed: [k, 2] float64, its place in the distorted photo in pixels; pixel centres at +0.5.
        error: Mean reprojection error in pixels.
    """

    names: list[str]
    poses: np.ndarray
    lenses: list[Lens]
    points: np.ndarray
    photo_of: np.ndarray
    point_of: np.ndarray
    observed: np.ndarray
    error: float


def reconstruct(
    photos: list[Photograph],
    images: Path,
    folder: Path,
    seed: int,
    report: Callable[[str, float], None],
    moving: Path | None = None,
) -> Reconstruction:
    """Finds cameras and sparse points. Raises InputError where fewer than three photos fit together.

    Args:
        images: A folder with the photos, upright, as `GROUP/NAME.png` or `.jpg`, see :func:`file_name`; the photos of a
            group share a lens.
        folder: A working folder; what is found there of an earlier, interrupted call is used.
        report: Called with the step's name and the share done.
        moving: A folder with a mask `GROUP/FILE.png` of each photo, outside of which no features are taken; None: they are
            taken everywhere.
    """
    database = folder / "colmap.db"
    if database.exists() and not _is_sound(database):
        note(f"{database}: is damaged; the photos' features are searched for again")
        database.unlink()
    extraction, pipeline = pycolmap.FeatureExtractionOptions(), pycolmap.IncrementalPipelineOptions()
    extraction.max_image_size, extraction.sift.max_num_features = LONGEST, MOST_FEATURES
    reader = pycolmap.ImageReaderOptions()
    reader.camera_model = "RADIAL"  # with OPENCV's two focal lengths, half of the mappings of few photos end elsewhere
    if moving is not None:
        reader.mask_path = moving
    pipeline.random_seed = pipeline.mapper.random_seed = seed
    pipeline.structure_less_registration_fallback = False  # slow, and places photos that show none of the points
    for part in (pipeline, pipeline.mapper, pipeline.triangulation):
        part.min_focal_length_ratio, part.max_focal_length_ratio = FOCAL_RANGE
    n = len(photos)
    with _quiet():
        with _counted(database, "keypoints", n, lambda share: report("features", share)):
            pycolmap.extract_features(
                database,
                images,
                camera_mode=pycolmap.CameraMode.PER_FOLDER,
                reader_options=reader,
                extraction_options=extraction,
            )
        pairs, pairing = photo_pairs(n), pycolmap.ImportedPairingOptions()
        files = {unquote(file.stem): f"{file.parent.name}/{file.name}" for file in images.glob("*/*")}
        names = [files[photo.name] for photo in photos]
        pairing.match_list_path, pairing.block_size = folder / "pairs.txt", BLOCK
        pairing.match_list_path.write_text("".join(f"{names[i]} {names[j]}\n" for i, j in pairs))
        with _counted(database, "two_view_geometries", len(pairs), lambda share: report("matches", share)):
            pycolmap.match_image_pairs(database, pairing_options=pairing)
        model = _best_model(database, images, folder, pipeline, lambda share: report("cameras", share))
        if model is None or model.num_reg_images() < MIN_PHOTOS:
            with closing(sqlite3.connect(database)) as base:
                n_features = base.execute("SELECT SUM(rows) FROM keypoints").fetchone()[0] or 0
            if n_features < LEAST_DETAIL * n:
                raise InputError(
                    f"{photos[0].path.parent}: the photos show too little detail; put the object on a pattern"
                )
            otherwise = "" if moving is not None else ", or give --turntable where it turned before the camera"
            raise InputError(
                f"{photos[0].path.parent}: the photos do not fit together; take more, each with two thirds in common with "
                f"the next, of an object that does not move on a table with a pattern{otherwise}"
            )
        if not _are_possible(model):
            note(
                f"{photos[0].path.parent}: the cameras are uncertain (pixels that are not square, or extreme angles of view); "
                "check prepare.html, and give photos of one lens in the proportions that the camera gave them"
            )
    return _taken_out(model)


def file_name(name: str) -> str:
    """A photo's name without the spaces that end a name in a list of pairs; `unquote` brings them back."""
    return re.sub(r"[\s%]", lambda found: quote(found[0]), name)


def photo_pairs(n: int) -> list[tuple[int, int]]:
    """The pairs of n photos that are matched, each once: all; of more than EXHAUSTIVE those near in the order of names."""
    if n <= EXHAUSTIVE:  # tile by tile, so that the features of a tile's photos stay in memory
        return sorted(combinations(range(n), 2), key=lambda pair: (pair[0] // TILE, pair[1] // TILE))
    steps = [*range(1, OVERLAP + 1), *(2**k for k in range(n.bit_length()) if 2**k > OVERLAP)]
    return [(i, i + step) for i in range(n) for step in steps if i + step < n]


def _best_model(
    database: Path,
    images: Path,
    folder: Path,
    options: pycolmap.IncrementalPipelineOptions,
    report: Callable[[float], None],
) -> pycolmap.Reconstruction | None:
    """The largest model, adjusted. Where its cameras are doubtful, models with pixels that need not be square, with a lens for each
    photo and then for those of about one focal length are tried too: photos may be squeezed, zoomed or cut without a word in
    their files. The model that explains most is taken; further lenses must be worth it."""
    with closing(pycolmap.Database.open(database)) as base:
        n = base.num_images()

    def mapped(source: Path) -> pycolmap.Reconstruction | None:
        placed = iter(range(3, n + 1))
        shown = {"next_image_callback": lambda: report(next(placed, n) / n)}
        models = pycolmap.incremental_mapping(source, images, folder, options, **shown)
        model = max(models.values(), key=lambda found: found.num_reg_images(), default=None)
        return model and _adjusted(model)

    def explained(model: pycolmap.Reconstruction | None) -> int:
        return 0 if model is None else model.compute_num_observations() - OF_A_LENS * model.num_cameras()

    best, lenses = mapped(database), folder / "lenses.db"
    for turn in range(TRIES):
        if best is not None and not _is_doubtful(best, n) and (turn or _are_possible(best)):
            break
        found = [best, mapped(_with_lenses(database, lenses, "OPENCV", {}, {}))]
        lens_of, focal = {photo: photo for photo in range(n + 1)}, {}
        for _ in range(GROUPINGS):
            found.append(mapped(_with_lenses(database, lenses, "RADIAL", lens_of, focal)))
            focal |= _focal_lengths(found[-1])
            if lens_of == (lens_of := _alike(focal)):
                break
        best = max(found, key=explained)
        options.random_seed = options.mapper.random_seed = options.random_seed + 1
    lenses.unlink(missing_ok=True)
    return best


def _with_lenses(database: Path, target: Path, model: str, lens_of: dict[int, int], focal: dict[int, float]) -> Path:
    """A copy of a database with a camera per size and lens; `lens_of` and the first focal lengths go by COLMAP's photo numbers."""
    shutil.copy(database, target)
    with closing(pycolmap.Database.open(target)) as base:
        before, made = {camera.camera_id: camera for camera in base.read_all_cameras()}, {}
        for image in base.read_all_images():
            key = image.camera_id, lens_of.get(image.image_id)
            if key not in made:
                camera = before[image.camera_id]
                length = focal.get(image.image_id, camera.focal_length_x)
                camera = pycolmap.Camera.create_from_model_name(0, model, length, camera.width, camera.height)
                camera.camera_id, rig = base.write_camera(camera), pycolmap.Rig()
                rig.add_ref_sensor(camera.sensor_id)
                made[key] = camera.camera_id, base.write_rig(rig)
            image.camera_id, rig_id = made[key]
            frame = pycolmap.Frame(frame_id=image.frame_id, rig_id=rig_id)
            frame.add_data_id(image.data_id)
            base.update_frame(frame), base.update_image(image)
    return target


def _focal_lengths(model: pycolmap.Reconstruction | None) -> dict[int, float]:
    """The focal length of each placed photo by the points that it shows, whatever lens it was given."""
    found, options = {}, pycolmap.AbsolutePoseRefinementOptions(refine_focal_length=True)
    for image in map(model.image, model.reg_image_ids()) if model else ():
        seen = [image.points2D[index] for index in image.get_observation_point2D_idxs()]
        lens = pycolmap.Camera(image.camera.todict())
        places, points = [point.xy for point in seen], [model.points3D[point.point3D_id].xyz for point in seen]
        pycolmap.refine_absolute_pose(image.cam_from_world(), places, points, [True] * len(seen), lens, options)
        found[image.image_id] = lens.focal_length_x
    return found


def _alike(focal: dict[int, float]) -> dict[int, int]:
    """For each photo the first one of those with its lens: their focal lengths lie together, by at most ONE_LENS from one to the
    next, or by UNSURE from the median of some, since a photo alone says it less surely."""
    groups = []
    for photo in sorted(focal, key=focal.get):
        if groups and focal[photo] < (1 + ONE_LENS) * focal[groups[-1][-1]]:
            groups[-1].append(photo)
        else:
            groups.append([photo])
    lenses = {median([focal[photo] for photo in group]): group for group in groups if len(group) >= MIN_PHOTOS}
    for group in [group for group in groups if len(group) < MIN_PHOTOS]:
        own = median([focal[photo] for photo in group])
        nearest = min(lenses, key=lambda length: abs(length - own), default=0.0)
        if abs(nearest - own) < UNSURE * own:
            lenses[nearest] += group
            groups.remove(group)
    return {photo: min(group) for group in groups for photo in group}


def _is_doubtful(model: pycolmap.Reconstruction, n: int) -> bool:
    """Whether cameras may be wrong: some of n photos have none, or they explain the features badly."""
    sure = SURE if n > FEW else SURE_OF_FEW
    return model.num_reg_images() < (1 - LOST) * n or model.compute_mean_reprojection_error() > sure


def _are_possible(model: pycolmap.Reconstruction) -> bool:
    """Whether the pixels of all placed photos are square and their focal lengths within FOCAL_RANGE."""
    cameras = [model.image(key).camera for key in model.reg_image_ids()]
    return all(
        _is_in_range(c) and abs(c.focal_length_x - c.focal_length_y) < ONE_LENS * c.focal_length_x for c in cameras
    )


def _is_in_range(camera: pycolmap.Camera) -> bool:
    """Whether a camera's focal length is within FOCAL_RANGE."""
    least, most = FOCAL_RANGE
    return least < camera.focal_length_x / max(camera.width, camera.height) < most


def _adjusted(model: pycolmap.Reconstruction) -> pycolmap.Reconstruction:
    """The model with everything refined at once: principal points, which stay at the centres where few photos leave them open, and
    all of OPENCV's lens where enough photos have it. Photos with too few of the points lose their cameras. Cauchy's loss keeps
    points that are no points, such as highlights and mirrored lamps, from pulling at the cameras."""
    shortest = SHORTEST if model.num_reg_images() > FEW else 2
    photos_of = Counter(image.camera_id for image in map(model.image, model.reg_image_ids()))
    often = [key for key, n in photos_of.items() if n >= MIN_PHOTOS]
    for principal_points in (True, False) if len(often) == len(photos_of) else (False,):
        refined = pycolmap.Reconstruction(model)
        for key in often:
            _in_opencv(refined.cameras[key])
        options, chosen = pycolmap.BundleAdjustmentOptions(), pycolmap.BundleAdjustmentConfig()
        options.refine_principal_point, options.print_summary = principal_points, False
        options.ceres.loss_function_type = pycolmap.LossFunctionType.CAUCHY
        options.ceres.loss_function_scale = OUTLIER
        options.ceres.solver_options.max_num_iterations = ITERATIONS
        for image in refined.reg_image_ids():
            chosen.add_image(image)
        chosen.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
        for _ in range(ADJUSTMENTS):
            pycolmap.create_default_bundle_adjuster(options, chosen, refined).solve()
            refined.update_point_3d_errors()
            points = refined.points3D.items()
            for key in [k for k, point in points if point.error > MAX_ERROR or point.track.length() < shortest]:
                refined.delete_point3D(key)
        if all(_is_central(refined.cameras[key]) for key in often):
            break

    def is_weak(image: pycolmap.Image) -> bool:
        return image.num_points3D < LEAST_SEEN or (image.camera_id not in often and not _is_in_range(image.camera))

    while weak := [image for image in map(refined.image, refined.reg_image_ids()) if is_weak(image)]:
        refined.deregister_frame(weak[0].frame_id)  # which takes points from others
    for key in set(refined.cameras) - set(often):
        _in_opencv(refined.cameras[key])
    return refined


def _in_opencv(camera: pycolmap.Camera) -> None:
    """Gives a camera of the model RADIAL that of OpenCV."""
    if camera.model == pycolmap.CameraModelId.RADIAL:
        f, *rest = camera.params
        camera.model, camera.params = pycolmap.CameraModelId.OPENCV, [f, f, *rest, 0.0, 0.0]


def _is_central(camera: pycolmap.Camera) -> bool:
    """Whether a camera's principal point is near the middle of its photos."""
    size = np.array([camera.width, camera.height])
    return bool((np.abs(np.array(camera.params[2:4]) - size / 2) < CENTRAL * size).all())


def _taken_out(model: pycolmap.Reconstruction) -> Reconstruction:
    numbers = {key: i for i, key in enumerate(sorted(model.points3D))}
    named = {unquote(Path(model.images[key].name).stem): model.images[key] for key in model.reg_image_ids()}
    poses, lenses, photo_of, point_of, observed = [], [], [], [], []
    for i, name in enumerate(sorted(named)):
        image = named[name]
        world_to_camera = np.vstack([image.cam_from_world().matrix(), [0, 0, 0, 1]])
        poses.append(np.linalg.inv(world_to_camera) @ OPENCV_AXES)
        lenses.append(Lens(image.camera.width, image.camera.height, *map(float, image.camera.params)))
        for index in image.get_observation_point2D_idxs():
            point = image.points2D[index]
            photo_of.append(i), point_of.append(numbers[point.point3D_id]), observed.append(point.xy)
    return Reconstruction(
        sorted(named),
        np.array(poses),
        lenses,
        np.array([model.points3D[key].xyz for key in sorted(model.points3D)]),
        np.array(photo_of),
        np.array(point_of),
        np.array(observed),
        float(model.compute_mean_reprojection_error()),
    )


@contextmanager
def _quiet() -> Iterator[None]:
    """Keeps COLMAP's log to what ends the program: errors that are raised have our own words."""
    log = pycolmap.logging
    before = log.minloglevel, log.alsologtostderr
    log.minloglevel, log.alsologtostderr = log.Level.FATAL.value, False
    try:
        yield
    finally:
        log.minloglevel, log.alsologtostderr = before


def _is_sound(database: Path) -> bool:
    """Whether a file is a database of SQLite that can be read."""
    try:
        with closing(sqlite3.connect(database)) as base:
            return base.execute("PRAGMA quick_check").fetchone() == ("ok",)
    except sqlite3.DatabaseError:
        return False


@contextmanager
def _counted(database: Path, table: str, total: int, report: Callable[[float], None]) -> Iterator[None]:
    """Reports the share of a table's rows while a step of COLMAP fills it. A process of its own counts them: two copies of
    SQLite in one process lose each other's locks on a file."""
    child = subprocess.Popen(
        [sys.executable, "-c", COUNT, str(database), table],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )

    def watch() -> None:
        for rows in child.stdout:
            report(min(1.0, int(rows) / max(total, 1)))

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield
    finally:
        child.kill()
        child.wait()
        thread.join()
