"""The pre-integrated light g(w, rho) as one network."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from splitnerf.fields.light import Light


class LightMlp(Light):
    """g(w, rho): radiance of the environment filtered by the lobe of roughness rho, never negative.

    g(w, 0) is the environment itself and g(n, 1) the irradiance over pi. The inputs are sines and cosines of 2^k w and
    of 2^k rho; the output layer reads them again beside the last hidden layer.

    Args:
        width, n_layers: The units of a hidden ReLU layer, and the number of these layers.
        direction_frequencies, roughness_frequencies: The numbers of octaves k of the two encodings.
        activation: The output's activation: ``softplus`` (the paper) or ``exp`` of a value clamped to [-12, 12], with
            which few units represent bright lamps.

    Source: SplitNeRF Eq. (8)-(9) and its supplement.
    """

    def __init__(
        self,
        width: int = 256,
        n_layers: int = 5,
        direction_frequencies: int = 10,
        roughness_frequencies: int = 5,
        activation: str = "softplus",
    ):
        super().__init__()
        self.activation = activation
        self.register_buffer("direction_scales", 2.0 ** torch.arange(direction_frequencies), persistent=False)
        self.register_buffer("roughness_scales", 2.0 ** torch.arange(roughness_frequencies), persistent=False)
        n_inputs = 6 * direction_frequencies + 2 * roughness_frequencies
        self.hidden = nn.ModuleList(nn.Linear(n_inputs if i == 0 else width, width) for i in range(n_layers))
        self.out = nn.Linear(width + n_inputs, 3)
        nn.init.normal_(self.out.weight, std=0.01)
        start = 0.5
        nn.init.constant_(self.out.bias, math.log(math.expm1(start)) if activation == "softplus" else math.log(start))

    def encode(self, directions: Tensor, roughness: Tensor) -> Tensor:
        w = (directions[:, :, None] * self.direction_scales).flatten(1)
        r = roughness * self.roughness_scales
        return torch.cat([w.sin(), w.cos(), r.sin(), r.cos()], dim=1)

    def forward(self, directions: Tensor, roughness: Tensor) -> Tensor:
        """directions [n, 3] unit, roughness [n, 1] in [0, 1] -> radiance [n, 3] >= 0."""
        encoded = self.encode(directions, roughness)
        h = encoded
        for layer in self.hidden:
            h = F.relu(layer(h))
        raw = self.out(torch.cat([h, encoded], dim=1))
        return F.softplus(raw) if self.activation == "softplus" else torch.exp(raw.clamp(-12.0, 12.0))
