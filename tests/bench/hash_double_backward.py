"""Two ways to the gradient of a loss on SDF normals, timed in one run after checking that they agree.

(a) hash_encode_jacobian returns the derivative as an output: normals are a product of two tensors and the loss
    needs one backward pass.
(b) torch.autograd.grad(create_graph=True) through hash_encode: the loss needs a double backward.

The field is a hash grid of 12 levels x 2 features, table size 2^17, under one softplus layer; the loss is
the eikonal term plus a target on the unit normals; gradients go to the table and the layer.
"""

from __future__ import annotations

from functools import partial

import torch
from torch.nn import functional as F

from splitnerf.bench.harness import interleaved
from splitnerf.ops import HashGridSpec, growth_for, hash_encode, hash_encode_jacobian

SPEC = HashGridSpec(n_levels=12, n_features=2, base_resolution=16, growth=growth_for(16, 512, 12), log2_table_size=17)
BETA = 100.0


def normals_by_jacobian(x, table, w1, w2):
    features, jacobian = hash_encode_jacobian(x, table, SPEC)
    pre = torch.cat([x, features], dim=1) @ w1.t()
    slope = (torch.sigmoid(BETA * pre) * w2) @ w1
    return slope[:, :3] + (jacobian * slope[:, None, 3:]).sum(-1)


def normals_by_double_backward(x, table, w1, w2):
    x = x.detach().requires_grad_()
    pre = torch.cat([x, hash_encode(x, table, SPEC)], dim=1) @ w1.t()
    sdf = F.softplus(pre, BETA, threshold=50) @ w2  # torch cuts at 20 by default, an error of e^-20 in the slope
    return torch.autograd.grad(sdf.sum(), x, create_graph=True)[0]


def loss_gradients(normals_of, x, target, parameters):
    normals = normals_of(x, *parameters)
    length = normals.norm(dim=1, keepdim=True)
    loss = 0.1 * (length - 1).square().mean() + (normals / length - target).square().mean()
    return torch.autograd.grad(loss, parameters)


def inputs(n: int, dtype: torch.dtype):
    draw = torch.Generator().manual_seed(0)
    x = torch.rand(n, 3, generator=draw, dtype=dtype)
    target = F.normalize(torch.randn(n, 3, generator=draw, dtype=dtype), dim=1)
    shapes = ((SPEC.n_entries, 2), (64, 3 + SPEC.n_outputs), (64,))
    parameters = tuple((0.3 * torch.randn(s, generator=draw, dtype=dtype)).requires_grad_() for s in shapes)
    return x, target, parameters


def check() -> float:
    """Largest relative difference of the two gradients in float64."""
    x, target, parameters = inputs(2000, torch.float64)
    a, b = (loss_gradients(f, x, target, parameters) for f in (normals_by_jacobian, normals_by_double_backward))
    return max(((p - q).abs().max() / q.abs().max()).item() for p, q in zip(a, b))


def main() -> None:
    difference = check()
    assert difference < 1e-9, f"the two gradients differ by {difference:.1e}"
    print(f"gradients agree to {difference:.1e} (float64); {torch.get_num_threads()} threads")
    for n in (10_000, 100_000):
        x, target, parameters = inputs(n, torch.float32)
        ways = {"jacobian": normals_by_jacobian, "double backward": normals_by_double_backward}
        calls = {name: partial(loss_gradients, way, x, target, parameters) for name, way in ways.items()}
        times = interleaved(calls, 15)
        said = ", ".join(f"{name} {1e3 * times[name].seconds:.1f} ms" for name in calls)
        print(f"{n} points: {said}, ratio {times.ratio('double backward', 'jacobian')}")


if __name__ == "__main__":
    main()
