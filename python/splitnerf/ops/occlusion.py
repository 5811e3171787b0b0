"""A triangle mesh that rays are traced in, and the occlusion factors of points.

The mesh is traced on the CPU. Tensors on another device are copied to the CPU, and the results are copied back; the
caller waits for both copies.

The operator has no gradient, since its outputs are targets of the training; a backward pass raises.
"""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from splitnerf import _core
from splitnerf.ops._library import lib, register


class MeshScene:
    """A triangle mesh ready to be traced; the operators take its ``handle``.

    The acceleration structure lives as long as the object. A changed mesh needs a new object.

    Args:
        vertices: [n, 3] float32, scene units.
        faces: [m, 3] int32.

    Raises:
        ValueError: The mesh is empty, an index is out of range or a vertex is not finite.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray):
        self._scene = _core.Scene(
            np.ascontiguousarray(vertices, dtype=np.float32), np.ascontiguousarray(faces, dtype=np.int32)
        )
        self.handle: int = self._scene.handle

    def trace_closest(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The nearest hits of rays.

        Args:
            origins, directions: [n, 3] float32.

        Returns:
            triangle [n] int64, -1 for a miss, and barycentric coordinates u, v [n] of its second and third corner.

        Raises:
            ValueError: A shape or dtype does not fit.
        """
        return self._scene.trace_closest(origins, directions)[1:]

    def is_open(self, origins: Tensor, directions: Tensor, t_far: float = math.inf) -> Tensor:
        """Whether each ray meets no triangle.

        Args:
            origins, directions: [n, 3] float32 on the CPU. Neighbours in the arrays should be neighbours in space, since
                rays are traced in packets of 16.
            t_far: The length of the rays in multiples of ``directions``.

        Returns:
            [n] bool, True where the ray is open.

        Raises:
            ValueError: A shape or dtype does not fit.
        """
        rays = (x.contiguous().numpy() for x in (origins, directions))
        return torch.from_numpy(self._scene.trace_visibility(*rays, t_far))


def occlusion_factors(
    scene: MeshScene,
    positions: Tensor,
    normals: Tensor,
    lobe_dirs: Tensor,
    roughness: Tensor,
    environment: Tensor,
    *,
    n_diffuse_rays: int = 64,
    n_specular_rays: int = 64,
    offset: float = 0.0125,
    along_ray: bool = False,
    seed: int = 0,
    n_channels: int = 1,
) -> tuple[Tensor, Tensor]:
    r"""The shares of the diffuse and of the specular light that reach points without meeting the mesh.

    .. math:: o_d = \frac{\sum_i L_i V_i}{\sum_i L_i}

    over cosine-weighted directions about the normal; o_s is the same ratio over directions of the lobe
    :math:`D(w) (w \cdot d)^+` about ``lobe_dirs``. Each point is sampled, traced and summed by itself, so that
    no [points, rays] array exists. Where the light is black, the factors are the shares of open directions.

    Args:
        scene: The mesh.
        positions, normals: [n, 3] positions (scene units) and unit normals.
        lobe_dirs: [n, 3] unit axes of the specular lobe (:func:`splitnerf.ops.light_queries`).
        roughness: [n, 1] perceptual roughness in [0, 1].
        environment: [height, width, 3] radiance, equirectangular (z up, centre column along +x).
        n_diffuse_rays, n_specular_rays: The numbers of rays per point.
        offset: The distance of a ray's start from its point, scene units.
        along_ray: Whether the start is moved along the ray instead of along the normal.
        seed: The seed of the random shift that each point's lattice of rays gets.
        n_channels: 1 averages the factors over the colour channels, 3 keeps them.

    Returns:
        o_d and o_s, [n, n_channels] in [0, 1], 1 = open.

    Raises:
        ValueError: A shape, dtype or count does not fit.
        IndexError: The scene no longer exists.

    Source: SplitNeRF Eq. (14), (15), with the specular lobe about the reflection.
    """
    if n_channels not in (1, 3):
        raise ValueError(f"occlusion_factors: n_channels must be 1 or 3, got {n_channels}")
    o_d, o_s = lib.occlusion_factors(
        scene.handle,
        *(x.cpu() for x in (positions, normals, lobe_dirs, roughness, environment)),
        n_diffuse_rays,
        n_specular_rays,
        offset,
        along_ray,
        seed,
    )
    o_d, o_s = o_d.to(positions.device), o_s.to(positions.device)
    return (o_d, o_s) if n_channels == 3 else (o_d.mean(-1, keepdim=True), o_s.mean(-1, keepdim=True))


register(
    "occlusion_factors",
    fake=lambda scene, positions, *rest: (positions.new_empty(positions.shape), positions.new_empty(positions.shape)),
)
