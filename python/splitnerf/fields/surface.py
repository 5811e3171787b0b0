"""The surface: its signed distance on a progressive hash grid, and small networks on its outputs, of materials and occlusion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from splitnerf.devices import tensor_cores
from splitnerf.fields.occlusion import Occlusion
from splitnerf.ops import HashGrid, HashGridSpec, sdf_field
from splitnerf.ops.sdf import SdfNetwork, sdf_values

SOFTPLUS_BETA = 100.0


class SdfSample(NamedTuple):
    """The field at a batch of points: `outputs` [n, n_outputs], of which the first is the signed distance (scene units, negative
    inside), `features` [n, C] of the hash grid, and `gradient` [n, 3], d sdf / d position."""

    outputs: Tensor
    features: Tensor
    gradient: Tensor

    @property
    def sdf(self) -> Tensor:
        return self.outputs[:, 0]


class SdfField(nn.Module):
    """sdf(x) = W2 softplus_100(W1 [x, hash(x)] + b1) + b2, with weight normalisation.

    The gradient of one hidden layer has a closed form, so that a loss on normals needs a single backward pass. The hash
    grid contributes through its Jacobian (:func:`splitnerf.ops.sdf.sdf_field`).

    Args:
        box: Half size of the cube that the grid covers, scene units.
        width: The number of hidden units.
        n_outputs: The number of outputs, with the distance.
        radius: The radius of the sphere that the field starts as, scene units.
        table_dtype: The dtype in which the hash table is read, see :class:`splitnerf.ops.sdf.HashGrid`.

    Source: NeuS (Wang et al. 2021) on a hash grid (Mueller et al. 2022), with the sizes of SplitNeRF's supplement;
    sphere initialisation: Atzmon and Lipman 2020.
    """

    def __init__(
        self,
        spec: HashGridSpec,
        box: float,
        width: int = 64,
        n_outputs: int = 13,
        radius: float = 0.5,
        table_dtype: torch.dtype | None = None,
    ):
        super().__init__()
        self.box = box
        self.grid = HashGrid(spec, table_dtype=table_dtype)
        hidden = torch.zeros(width, 3 + spec.n_outputs)
        hidden[:, :3] = torch.randn(width, 3) * math.sqrt(2.0 / width)
        out = torch.randn(n_outputs, width) * math.sqrt(1.0 / width)
        out[0] = math.sqrt(math.pi / width) + torch.randn(width) * 1e-4
        bias = torch.zeros(n_outputs)
        bias[0] = -radius
        self.hidden_direction = nn.Parameter(hidden)
        self.hidden_length = nn.Parameter(hidden.norm(dim=1, keepdim=True))
        self.hidden_bias = nn.Parameter(torch.zeros(width))
        self.out_direction = nn.Parameter(out)
        self.out_length = nn.Parameter(out.norm(dim=1, keepdim=True))
        self.out_bias = nn.Parameter(bias)

    def _weights(self) -> tuple[Tensor, Tensor]:
        """Weight normalisation: each row is length * direction / |direction|."""
        return (
            torch._weight_norm(self.hidden_direction, self.hidden_length),
            torch._weight_norm(self.out_direction, self.out_length),
        )

    def forward(self, positions: Tensor, n_outputs: int | None = None) -> tuple[Tensor, Tensor]:
        """The first n_outputs outputs [n, n_outputs] (default: all) and the hash features [n, C] at positions [n, 3], scene
        units."""
        features = self.grid(positions * (0.5 / self.box) + 0.5)
        hidden, out = self._weights()
        h = F.softplus(F.linear(torch.cat([positions, features], dim=1), hidden, self.hidden_bias), SOFTPLUS_BETA)
        return F.linear(h, out[:n_outputs], self.out_bias[:n_outputs]), features

    def sdf(self, positions: Tensor) -> Tensor:
        """Signed distance [n] at positions [n, 3], scene units."""
        if not torch.is_grad_enabled():
            return sdf_values(positions, self.network())
        return self(positions, 1)[0][:, 0]

    @torch.no_grad()
    def network(self) -> SdfNetwork:
        """The field's current numbers, for operators that evaluate distances themselves."""
        hidden, out = self._weights()
        stored, biases = self.grid.stored(), (self.hidden_bias.detach(), self.out_bias.detach())
        table = self.grid.table.detach() if stored is None else stored
        return SdfNetwork(
            self.grid.spec, self.grid.n_active, table, hidden, biases[0], out, biases[1], SOFTPLUS_BETA, self.box
        )

    def sample(self, positions: Tensor) -> SdfSample:
        """Outputs, grid features and the analytic gradient in one pass, differentiable once in all parameters, not in positions."""
        outputs, features, gradient = sdf_field(
            positions,
            self.grid.table,
            hidden=self.hidden_direction,
            hidden_length=self.hidden_length,
            hidden_bias=self.hidden_bias,
            out=self.out_direction,
            out_length=self.out_length,
            out_bias=self.out_bias,
            beta=SOFTPLUS_BETA,
            box=self.box,
            spec=self.grid.spec,
            n_active=self.grid.n_active,
            stored=self.grid.stored(),
        )
        return SdfSample(outputs, features, gradient)

    def sample_finite_difference(self, positions: Tensor, cells: float = 1.0) -> SdfSample:
        """The values of :meth:`sample` at positions [n, 3], scene units, with the gradient by central differences (six evaluations)
        with a step of so many `cells` of the finest open level. Source: Neuralangelo (Li et al. 2023), section 3.1; SplitNeRF's
        released code does the same."""
        resolution = self.grid.spec.levels()[max(0, self.grid.n_active - 1)][0]
        eps = cells * 2.0 * self.box / resolution
        axes = torch.eye(3, dtype=positions.dtype, device=positions.device)
        steps = eps * torch.cat([axes, -axes])
        with tensor_cores(False):  # rounding to TF32 would exceed the differences
            taps = self.sdf((positions[:, None, :] + steps).reshape(-1, 3)).view(-1, 2, 3)
        return SdfSample(*self(positions), (taps[:, 0] - taps[:, 1]) / (2.0 * eps))


def relu_mlp(n_inputs: int, width: int, n_layers: int, n_outputs: int) -> nn.Sequential:
    """``n_layers`` hidden ReLU layers of ``width`` units and a linear output that starts near 0."""
    layers: list[nn.Module] = []
    for i in range(n_layers):
        layers += [nn.Linear(n_inputs if i == 0 else width, width), nn.ReLU(inplace=True)]
        nn.init.kaiming_uniform_(layers[-2].weight, nonlinearity="relu")
        nn.init.zeros_(layers[-2].bias)
    layers.append(nn.Linear(width, n_outputs))
    nn.init.normal_(layers[-1].weight, std=0.01)
    nn.init.zeros_(layers[-1].bias)
    return nn.Sequential(*layers)


class MaterialHead(nn.Module):
    """Predicts albedo (linear), roughness (perceptual) and metallic of a point, each in [0, 1] by a sigmoid. Roughness is rescaled
    to [``min_roughness``, 1]. The bias of metallic starts at -2, since most surfaces are not metal; this choice is ours, the paper
    does not give one. Source: SplitNeRF's material network; width and depth from its supplement."""

    def __init__(self, n_inputs: int, width: int, n_layers: int, initial_roughness: float, min_roughness: float):
        super().__init__()
        self.net = relu_mlp(n_inputs, width, n_layers, 5)
        self.min_roughness = min_roughness
        share = min(max((initial_roughness - min_roughness) / (1.0 - min_roughness), 1e-3), 1.0 - 1e-3)
        with torch.no_grad():
            self.net[-1].bias[3] = math.log(share / (1.0 - share))
            self.net[-1].bias[4] = -2.0

    def forward(self, *features: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """features [n, columns], n_inputs columns together -> albedo [n, 3], roughness [n, 1], metallic [n, 1]."""
        albedo, roughness, metallic = torch.sigmoid(self.net(torch.cat(features, 1))).split([3, 1, 1], dim=1)
        return albedo, self.min_roughness + (1.0 - self.min_roughness) * roughness, metallic


class OcclusionHead(nn.Module):
    """Predicts the occlusion factors o_d and o_s of a point, 1 = open, from its position alone (SplitNeRF Eq. (12)-(15)). The
    output biases start at +2, mostly open; this choice is ours."""

    def __init__(self, n_inputs: int, width: int, n_layers: int, n_channels: int):
        super().__init__()
        self.n_channels = n_channels
        self.net = relu_mlp(n_inputs, width, n_layers, 2 * n_channels)
        with torch.no_grad():
            self.net[-1].bias.fill_(2.0)

    def forward(self, features: Sequence[Tensor]) -> Occlusion:
        """features [n, columns], n_inputs columns together -> factors [n, n_channels]."""
        out = torch.sigmoid(self.net(torch.cat(list(features), dim=-1)))
        return Occlusion(out[:, : self.n_channels], out[:, self.n_channels :])
