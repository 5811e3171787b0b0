"""Path-traced pictures of the page's view: a small one first, then better ones."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from splitnerf.data.asset import Asset
from splitnerf.data.environment import rotate_environment
from splitnerf.data.layouts.frame import checked_pose
from splitnerf.errors import InputError
from splitnerf.relight.rendering import lowest
from splitnerf.render.path_traced import AssetRenderer

from splitnerf_tools.report.embedding import as_halves
from splitnerf_tools.view.assets import ViewedAssets

FIRST_SIDE = 256  # pixels of the first picture's longer side
LARGEST_SIDE, MOST_PIXELS = 4096, 1 << 22
PATHS_A_CALL = 1 << 16  # so that a call of the tracer ends soon after the camera moves
# Paths a pixel of the pictures of the whole size, each with those before it.
PASSES = (1, 1, 2, 4, 8, 16, 32, 64, 128, 256, 512)
MOST_PATHS = sum(PASSES)


@dataclass(frozen=True)
class Camera:
    """The camera of the page.

    Attributes:
        pose: [4, 4] float64 camera-to-world, OpenGL axes.
        intrinsics: (fx, fy, cx, cy) in pixels.
        width, height: Pixels.
        lights: The number of each asset's light.
        turn: Degrees by which the light is turned, counter-clockwise seen from above.
        ground: Whether the ground below the object shows its shadow.
        paths: Paths a pixel of the last picture, 1 to 1024.
    """

    pose: np.ndarray
    intrinsics: tuple[float, float, float, float]
    width: int
    height: int
    lights: tuple[int, ...]
    turn: float
    ground: bool = False
    paths: int = 256

    @staticmethod
    def of(content: object, n_assets: int) -> Camera:
        """The camera of a page's JSON, whose keys are the attributes. Raises InputError where a value is missing or cannot be
        used."""
        try:
            pose = np.reshape(np.array(content["pose"], np.float64), (4, 4))
            intrinsics = tuple(float(value) for value in content["intrinsics"])
            width, height, turn = int(content["width"]), int(content["height"]), float(content["turn"])
            ground, paths = bool(content.get("ground")), int(content.get("paths", 256))
            lights = tuple(int(number) for number in content["lights"])
        except (LookupError, TypeError, ValueError, OverflowError) as error:
            raise InputError(f"the camera cannot be read ({type(error).__name__}); load the page again") from None
        sizes = 1 <= min(width, height) and max(width, height) <= LARGEST_SIDE and width * height <= MOST_PIXELS
        lens = (
            len(intrinsics) == 4
            and np.isfinite(intrinsics).all()
            and 1e-3 < min(intrinsics[:2])
            and max(map(abs, intrinsics)) < 1e7
        )
        counts = len(lights) == n_assets and 1 <= paths <= MOST_PATHS
        if not (sizes and lens and counts and abs(turn) <= 3600):
            raise InputError("the camera has numbers beyond reason; load the page again")
        pose = checked_pose(pose, "the camera's pose")
        return Camera(pose, intrinsics, width, height, lights, turn, ground, paths)

    def scaled(self, side: int) -> Camera:
        """The same camera with a smaller picture, whose longer side has so many pixels."""
        share = min(1.0, side / max(self.width, self.height))
        width, height = (max(1, round(share * pixels)) for pixels in (self.width, self.height))
        fx, fy, cx, cy = self.intrinsics
        across, down = width / self.width, height / self.height
        return replace(self, intrinsics=(fx * across, fy * down, cx * across, cy * down), width=width, height=height)


@dataclass(frozen=True)
class Picture:
    """One picture of an asset."""

    asset: int
    width: int
    height: int
    spp: int  # paths a pixel
    content: bytes  # [height, width] float16 RGBA, linear, premultiplied


class Tracer:
    """Traces one request at a time; a newer request ends the one before."""

    def __init__(self, shown: ViewedAssets):
        self._shown = shown
        # Of the newest asset of each number, and its ground.
        self._renderers: dict[int, tuple[Asset, AssetRenderer, float]] = {}
        self._newest, self._counting, self._working = 0, threading.Lock(), threading.Lock()

    def pictures(self, camera: Camera, gone: Callable[[], bool]) -> Iterator[Picture]:
        """Better and better pictures of each asset, until all passes are made, a newer request comes, or `gone` returns true.
        Raises InputError where a light is no longer kept."""
        mine = self._next()
        lights = [self._light(number, camera.turn) for number in camera.lights]

        def ended() -> bool:
            return self._newest != mine or gone()

        with self._working:
            scenes = [(*self._renderer(asset), light) for asset, light in enumerate(lights)]
        yield from self._refined(camera.scaled(FIRST_SIDE), scenes, PASSES[:1], ended)
        yield from self._refined(camera, scenes, PASSES, ended)

    def stop(self) -> None:
        """Ends the present request and waits for it, so that no thread is within the tracer when the program ends."""
        self._next()
        with self._working:
            pass

    def _next(self) -> int:
        with self._counting:
            self._newest += 1
            return self._newest

    def _light(self, number: int, turn: float) -> np.ndarray:
        light = self._shown.light(number)
        if light is None:
            raise InputError("this light is no longer kept; drop it again")
        return rotate_environment(light.radiance, turn)

    def _renderer(self, asset: int) -> tuple[AssetRenderer, float]:
        newest = self._shown.sources[asset].asset
        if asset not in self._renderers or self._renderers[asset][0] is not newest:
            self._renderers[asset] = newest, AssetRenderer(newest), lowest(newest)
        return self._renderers[asset][1:]

    def _refined(
        self,
        camera: Camera,
        scenes: list[tuple[AssetRenderer, float, np.ndarray]],
        passes: tuple[int, ...],
        ended: Callable[[], bool],
    ) -> Iterator[Picture]:
        """The mean of all passes so far, after each pass, for each asset with its light; a slow reader blocks no other request."""
        sums, total = [np.zeros((camera.height, camera.width, 4), np.float32) for _ in scenes], 0
        for number, spp in enumerate(passes):
            if total >= camera.paths:
                return
            total += spp
            for asset, scene in enumerate(scenes):
                with self._working:
                    if not self._add(sums[asset], scene, camera, spp, number, ended):
                        return
                width, height, content = as_halves(sums[asset] / total)
                yield Picture(asset, width, height, total, content)

    def _add(
        self,
        total: np.ndarray,
        scene: tuple[AssetRenderer, float, np.ndarray],
        camera: Camera,
        spp: int,
        seed: int,
        ended: Callable[[], bool],
    ) -> bool:
        """Adds spp paths a pixel, some rows at a time; False where it ended before."""
        renderer, ground, light = scene
        fx, fy, cx, cy = camera.intrinsics
        spp_a_call = min(spp, max(1, PATHS_A_CALL // camera.width))
        rows = max(1, PATHS_A_CALL // (camera.width * spp_a_call))
        for top in range(0, camera.height, rows):
            strip = total[top : top + rows]
            for call in range(-(-spp // spp_a_call)):
                if ended():
                    return False
                paths = min(spp_a_call, spp - call * spp_a_call)
                images = renderer.render(
                    light,
                    camera.pose,
                    (fx, fy, cx, cy - top),
                    camera.width,
                    len(strip),
                    spp=paths,
                    seed=(seed << 24) + (top << 11) + call,  # pictures of equal requests are equal
                    catcher_height=ground if camera.ground else None,
                )
                strip[..., :3] += paths * images["radiance"]
                strip[..., 3] += paths * (images["alpha"] + images.get("shadow", 0.0))
        return True
