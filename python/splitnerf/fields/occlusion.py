"""Occlusion factors: what every kind of them answers, and the paper's network."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn

from splitnerf.fields.heads import relu_mlp


class OcclusionQuery(NamedTuple):
    """Points that ask for their occlusion factors; a kind reads what it needs.

    Attributes:
        inputs: [n, n_inputs] of the heads.
        positions: [n, 3] on the surface.
        normals: [n, 3] unit, out of the surface.
        lobe_dirs: [n, 3] unit, axis of the specular lobe.
        roughness: [n, 1].
    """

    inputs: Tensor
    positions: Tensor
    normals: Tensor
    lobe_dirs: Tensor
    roughness: Tensor


class Occlusion(NamedTuple):
    """Which share of the light arrives, and what arrives from the object itself.

    Attributes:
        diffuse, specular: o_d and o_s, [n, 1] or [n, 3], 1 = open.
        indirect_diffuse, indirect_specular: [n, 3] linear, in the normalisation of g(n, 1) and g(d, rho), or None.
    """

    diffuse: Tensor
    specular: Tensor
    indirect_diffuse: Tensor | None = None
    indirect_specular: Tensor | None = None


class OcclusionHead(nn.Module):
    """Occlusion factors o_d and o_s of a point, 1 = open.

    With ``directional`` the specular factor also reads the lobe's axis and width, so that it is a
    function of the reflection; without it the head is the paper's, which depends on position alone.

    Source: SplitNeRF Eq. (12)-(15).
    """

    def __init__(self, n_inputs: int, width: int, n_layers: int, n_channels: int, directional: bool):
        super().__init__()
        self.n_channels, self.directional = n_channels, directional
        self.net = relu_mlp(n_inputs + (10 if directional else 0), width, n_layers, 2 * n_channels)
        with torch.no_grad():
            self.net[-1].bias.fill_(2.0)  # mostly open

    def forward(self, query: OcclusionQuery) -> Occlusion:
        """o_d and o_s, [n, n_channels] each."""
        features = query.inputs
        if self.directional:
            x, y, z = query.lobe_dirs.unbind(-1)
            products = torch.stack([x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1, z * z * z], dim=-1)
            features = torch.cat([features, query.lobe_dirs, products, query.roughness], dim=-1)
        out = torch.sigmoid(self.net(features))
        return Occlusion(out[:, : self.n_channels], out[:, self.n_channels :])
