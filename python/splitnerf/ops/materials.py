"""The network that predicts materials, in one pass."""

from __future__ import annotations

from collections.abc import Sequence

from torch import Tensor

from splitnerf.ops._library import lib, register


def material_network(
    inputs: Sequence[Tensor], weights: Sequence[Tensor], biases: Sequence[Tensor], min_roughness: float = 0.0
) -> tuple[Tensor, Tensor, Tensor]:
    """Albedo, roughness and metallic by a network of rectified layers and a sigmoid.

    ``x_0 = [inputs]``, ``x_l = max(weights_l x_(l-1) + biases_l, 0)``, and of the last layer the sigmoid, which is rescaled to
    [min_roughness, 1] for the roughness. The backward pass works the hidden values out again.

    Args:
        inputs: 1 to 4 tensors [n, columns] of one dtype, float32 or float64, joined by columns.
        weights: 1 to 16 of [outputs, inputs], as torch.nn.Linear stores them; the last one has 5 outputs.
        biases: [outputs] each.
        min_roughness: The smallest roughness, in [0, 1).

    Returns:
        albedo [n, 3], roughness [n, 1] and metallic [n, 1], each in [0, 1]. Differentiable once in inputs, weights and biases.

    Raises:
        ValueError: A shape, dtype or number does not fit; or, on a GPU, the layers are too wide for its shared memory: on an
            H100 in float32, where inputs, units and twice the widest layer are more than about 1,750 together.

    Source: SplitNeRF's material network.
    """
    return lib.material_network(list(inputs), list(weights), list(biases), min_roughness)


def _keep(ctx, inputs, output):
    parts, weights, biases, ctx.min_roughness = inputs
    ctx.lengths = len(parts), len(weights)
    ctx.save_for_backward(*parts, *weights, *biases)


def _backward(ctx, *grads):
    n_parts, n_layers = ctx.lengths

    def divided(tensors: Sequence[Tensor]) -> tuple[list[Tensor], ...]:
        tensors = list(tensors)
        return tensors[:n_parts], tensors[n_parts : n_parts + n_layers], tensors[n_parts + n_layers :]

    found = lib.material_network_backward(*divided(ctx.saved_tensors), ctx.min_roughness, *grads)
    return *divided(found), None


register(
    "material_network",
    fake=lambda inputs, *rest: tuple(inputs[0].new_empty(inputs[0].shape[0], columns) for columns in (3, 1, 1)),
    setup_context=_keep,
    backward=_backward,
)
register(
    "material_network_backward",
    fake=lambda inputs, weights, biases, *rest: [x.new_empty(x.shape) for x in (*inputs, *weights, *biases)],
)
