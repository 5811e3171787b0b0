"""material_network."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest
import torch
from op_checks import check_error, check_op, generator, lib
from shading_inputs import material_inputs

from splitnerf.fields import MaterialHead, heads
from splitnerf.ops import material_network

SHAPES = [((13, 8, 6), (5, 3, 5)), ((4,), (4,)), ((3, 70), (1, 2)), ((7, 5, 1, 9), (7,))]


def by_torch(inputs, weights, biases, min_roughness):
    x = torch.cat(inputs, 1)
    for weight, bias in zip(weights[:-1], biases[:-1]):
        x = torch.relu(torch.nn.functional.linear(x, weight, bias))
    albedo, roughness, metallic = torch.sigmoid(torch.nn.functional.linear(x, weights[-1], biases[-1])).split([3, 1, 1], 1)
    return albedo, min_roughness + (1 - min_roughness) * roughness, metallic


def leaves_of(arguments):
    """The arguments with all tensors as leaves, and these."""
    lists = [[x.detach().clone().requires_grad_() for x in given] for given in arguments[:3]]
    return (*lists, arguments[3]), [x for given in lists for x in given]


@pytest.mark.parametrize(("sizes", "parts"), SHAPES)
@pytest.mark.parametrize("n", [0, 1, 63, 64, 1100])
def test_it_is_torchs_layers_with_their_gradients(n, sizes, parts):
    """More points than a task has, and a block that is not full."""
    arguments = material_inputs(n, torch.float64, sizes, parts)
    grads = [torch.randn(n, k, generator=generator(k), dtype=torch.float64) for k in (3, 1, 2)]
    results = []
    for network in (material_network, by_torch):
        given, leaves = leaves_of(arguments)
        outputs = network(*given)
        sum((x * g[:, : x.shape[1]]).sum() for x, g in zip(outputs, grads)).backward()
        results.append([*outputs, *(x.grad for x in leaves)])
    for ours, theirs in zip(*results, strict=True):
        torch.testing.assert_close(ours, theirs, rtol=1e-11, atol=1e-12)


def test_gradcheck():
    (inputs, weights, biases, least), leaves = leaves_of(material_inputs(3, torch.float64, (5, 4), (3, 2)))

    def network(*x):
        return lib.material_network(list(x[:2]), list(x[2:4]), list(x[4:]), least)

    assert torch.autograd.gradcheck(network, leaves)
    with pytest.raises(RuntimeError, match="material_network_backward"):
        first = torch.autograd.grad(network(*leaves)[0].sum(), leaves[0], create_graph=True)[0]
        first.sum().backward()


def test_operators():
    arguments = material_inputs(9, torch.float32)
    check_op(lib.material_network, arguments)
    check_op(lib.material_network_backward, (*arguments, *(torch.rand(9, k) for k in (3, 1, 1))))
    torch.library.opcheck(lib.material_network, leaves_of(arguments)[0])


def test_float32_is_close_to_float64():
    exact, single = (material_network(*material_inputs(500, dtype)) for dtype in (torch.float64, torch.float32))
    for a, b in zip(single, exact):
        torch.testing.assert_close(a.double(), b, rtol=0, atol=1e-6)


def test_logits_of_any_size():
    """0 and 1 and no more; the slope where 1 - s has no float; a unit at 0 has no slope; NaN stays NaN."""
    logits = torch.tensor([-1e30, -200.0, 30.0, -100.0, 1e30])
    x = torch.zeros(1, 2, requires_grad=True)
    bias = logits.clone().requires_grad_()
    weights = [torch.eye(2), torch.ones(5, 2)]
    albedo, roughness, metallic = material_network([x], weights, [torch.zeros(2), bias], 0.25)
    assert albedo[0].tolist() == pytest.approx([0.0, 0.0, 1.0], abs=1e-30)
    assert roughness.item() == pytest.approx(0.25) and metallic.item() == 1.0
    (albedo.sum() + roughness.sum() + metallic.sum()).backward()
    assert torch.isfinite(bias.grad).all() and bias.grad[2].item() == pytest.approx(math.exp(-30), rel=1e-5)
    assert (x.grad == 0).all()
    broken = material_network([torch.tensor([[math.nan, 1.0], [1.0, 1.0]])], weights, [torch.zeros(2), logits])
    assert torch.isnan(broken[0][0]).all() and torch.isfinite(broken[0][1]).all()


def test_threads_do_not_change_the_bits():
    arguments = material_inputs(2000, torch.float32)
    grads = [torch.rand(2000, k, generator=generator(k)) for k in (3, 1, 1)]
    before, found = torch.get_num_threads(), []
    for threads in (1, 3):
        torch.set_num_threads(threads)
        found.append(lib.material_network_backward(*arguments, *grads))
    torch.set_num_threads(before)
    assert all(torch.equal(a, b) for a, b in zip(*found))


def test_the_head_is_the_same_both_ways(monkeypatch):
    """Inputs in parts or in one, by torch's layers, as on the CPU and where they are wide, or by the operator."""
    torch.manual_seed(0)
    head = MaterialHead(7, 8, 2, min_roughness=0.1)
    x, grads = torch.randn(20, 7), [torch.randn(20, k) for k in (3, 1, 1)]
    results = []
    for fused in (False, True):
        monkeypatch.setattr(heads, "is_fused", lambda *_, fused=fused: fused)
        for parts in ((x,), x.split([2, 5], 1)):
            head.zero_grad()
            outputs = head(*parts)
            torch.autograd.backward(outputs, grads)
            results.append([*outputs, *(p.grad for p in head.parameters())])
    for result in results[1:]:
        for a, b in zip(result, results[0], strict=True):
            torch.testing.assert_close(a, b, rtol=1e-5, atol=1e-6)


def test_only_narrow_layers_on_a_gpu_are_fused():
    on_gpu, on_cpu = (SimpleNamespace(is_cuda=x) for x in (True, False))
    assert heads.is_fused(on_gpu, 64) and heads.is_fused(on_gpu, 128)
    assert not heads.is_fused(on_gpu, 256) and not heads.is_fused(on_cpu, 64)


def test_what_does_not_fit_is_named():
    inputs, weights, biases, least = material_inputs(6, torch.float32, (4, 3), (2, 2))
    for arguments, words in (
        (([], weights, biases, least), ("inputs",)),
        (([x[:5] if i else x for i, x in enumerate(inputs)], weights, biases, least), ("inputs must be [6, n] float32", "[5, 2]")),
        ((inputs[:1], weights, biases, least), ("weights must be [n, 2] float32", "[3, 4]")),
        ((inputs, [weights[0], weights[1][:4]], biases, least), ("weights must be [5, 3]", "[4, 3]")),
        ((inputs, weights, [biases[1], biases[1]], least), ("biases must be [3]", "[5]")),
        ((inputs, weights, biases[:1], least), ("weights and biases must be as many, 1 to 16",)),
        ((inputs * 3, weights, biases, least), ("inputs must be 1 to 4",)),
        ((inputs, weights, biases, 1.0), ("min_roughness must be in [0, 1)",)),
        (([x.double() for x in inputs], weights, biases, least), ("weights must be", "float64", "float32")),
    ):
        check_error(lambda arguments=arguments: lib.material_network(*arguments), "material_network", *words)
