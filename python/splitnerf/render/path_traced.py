"""Renders a textured asset under an environment map by the path tracer."""

from __future__ import annotations

import numpy as np

from splitnerf import _core
from splitnerf.data.asset import Asset

CLAMP_INDIRECT = 10.0
MOST_SPP, LARGEST_PICTURE, MOST_VIEWS = 1 << 20, 1 << 14, 100_000  # paths a pixel, pixels of a side, pictures of a call


class AssetRenderer:
    """An asset with its acceleration structure, ready for any number of views and lights. Its arrays are not copied and must not
    change while the renderer exists. Raises ValueError where they do not fit together."""

    def __init__(self, asset: Asset):
        n = len(asset.vertices)
        self.asset = asset
        self._scene = _core.Scene(_float32(asset.vertices), np.ascontiguousarray(asset.triangles, np.int32))
        self._surface = {
            "albedo": np.ones((n, 3), np.float32) if asset.colors is None else _float32(asset.colors),
            "roughness": np.ones(n, np.float32),
            "metallic": np.ones(n, np.float32),
        }
        self._options = {
            "normals": _float32(asset.normals),
            "materials": _core.Materials(list(asset.materials)),
            "material_ids": np.ascontiguousarray(asset.material_ids, np.int32),
            "uv": None if asset.uv is None else _float32(asset.uv),
            "tangents": None if asset.tangents is None else _float32(asset.tangents),
        }

    def render(
        self,
        environment: np.ndarray,
        pose: np.ndarray,
        intrinsics: tuple[float, float, float, float],
        width: int,
        height: int,
        *,
        spp: int = 64,
        bounces: int = 4,
        seed: int = 0,
        clamp_indirect: float = CLAMP_INDIRECT,
        pixel_filter: str = "blackman-harris",
        catcher_height: float | None = None,
    ) -> dict[str, np.ndarray]:
        """Path-traces one view; equal seeds give equal images. Raises ValueError where a map, a pose or a size cannot be used.

        Args:
            environment: [h, w, 3] linear radiance >= 0, equirectangular, in Blender's convention.
            pose: [3 or 4, 4] camera-to-world, OpenGL axes.
            intrinsics: (fx, fy, cx, cy) in pixels, pixel centres at +0.5.
            width, height: Pixels.
            spp: Paths a pixel.
            bounces: Scattering events after the first one; 0 is direct light only.
            seed: The seed of the random numbers.
            clamp_indirect: The largest value of a channel in one indirect contribution, to suppress fireflies; 0 does
                not clamp and is unbiased.
            pixel_filter: "blackman-harris" (1.5 pixels wide, Blender's default) or "box".
            catcher_height: z of an invisible ground plane that shows the shadow of the direct light; None for none.

        Returns:
            float32 maps by name. `radiance` [height, width, 3] is linear and premultiplied by `alpha` [height, width].
            Maps of the first hit are not premultiplied, and 0 where a ray hits nothing: `albedo` [height, width, 3]
            linear, `roughness`, `metallic`, `normal` (world space, with the normal texture), `smooth_normal` (without
            the normal texture) and `depth` along the ray. With a catcher, `shadow` is the opacity of its black shadow
            (alpha + shadow <= 1).
        """
        return _core.render(
            self._scene,
            **self._surface,
            environment=_float32(environment),
            camera_to_world=_float32(pose[:3]),
            **dict(zip(("fx", "fy", "cx", "cy"), map(float, intrinsics))),
            width=width,
            height=height,
            **self._options,
            spp=spp,
            max_bounces=bounces,
            seed=seed,
            clamp_indirect=clamp_indirect,
            pixel_filter=pixel_filter,
            catcher_height=catcher_height,
        )


def _float32(values: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(values, np.float32)
