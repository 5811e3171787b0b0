"""splitnerf doctor: here all is well, and what is wrong is found."""

import json
import math
import os
import shutil
import sys

import numpy as np
import pytest
import torch
from op_cases import ON_THE_CPU_ALONE, OPERATORS
from pretend_gpu import pretend_gpu
from splitnerf import _core, devices
from splitnerf.cli import main
from splitnerf.cli.common import DONE, FAILED
from splitnerf.cli.train import device_for
from splitnerf.devices import fit_device
from splitnerf.errors import InputError
from splitnerf.export.textured import unwrap
from splitnerf_tools.doctor import machine, self_test
from splitnerf_tools.plugin import failing_operators
from tiny_runs import refused
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves


def off(x: torch.Tensor) -> torch.Tensor:
    """A hundredth too large; a whole number by one, a truth turned round."""
    return ~x if x.dtype == torch.bool else x * 1.01 if x.is_floating_point() else x + 1


class Spoilt(TorchDispatchMode):
    """Within it the nth tensor that an operator gives, or writes to, is changed; `reached` holds all that were called."""

    def __init__(self, name: str = "", change=off, output: int = 0):
        super().__init__()
        self.name, self.change, self.output, self.reached, self.n_outputs = name, change, output, set(), 0

    def __torch_dispatch__(self, operator, types, args=(), kwargs=None):
        result = operator(*args, **(kwargs or {}))
        if operator.namespace == "splitnerf":
            name = operator.__name__.partition(".")[0]
            self.reached.add(name)
            if name == self.name:
                written = [x for x, given in zip(args, operator._schema.arguments) if given.alias_info]
                outputs = [x for x in tree_leaves([result, written]) if isinstance(x, torch.Tensor)]
                self.n_outputs = len(outputs)
                if outputs[self.output].numel():
                    outputs[self.output].copy_(self.change(outputs[self.output]))
        return result


def test_every_operator_is_asked():
    with Spoilt() as mode:
        assert self_test.failures("cpu") == []
    assert mode.reached == OPERATORS
    assert self_test.operators("cpu") == [name for name in sorted(OPERATORS) if "_backward" not in name]
    assert self_test.CPU_ALONE == set(ON_THE_CPU_ALONE)


def test_the_answers_are_those_of_this_version(tmp_path):
    self_test.write_answers(tmp_path / "answers.json")
    now = json.loads((tmp_path / "answers.json").read_text())
    assert now.keys() == self_test.answers().keys()
    for name, known in self_test.answers().items():
        assert now[name].keys() == known.keys()
        for result, pair in known.items() if name not in self_test.CPU_ALONE else ():
            # Processors round differently: with AVX2 alone a roughness's gradient is 4e-7 of its size off.
            assert now[name][result] == pytest.approx(pair, rel=1e-6, abs=1e-6 * pair[1]), (name, result)


@pytest.mark.parametrize("name", sorted(OPERATORS))
def test_an_operator_that_is_off_is_found(name):
    """Each of its results, one after the other."""
    asked = name.split("_backward")[0]
    with Spoilt(name, lambda x: x) as mode:
        self_test.failures("cpu", [asked])
    for output in range(mode.n_outputs):
        with Spoilt(name, off, output):
            (failure,) = self_test.failures("cpu", [asked])
        assert (failure.operator, failure.device) == (asked, "cpu") and "weighted sum over its" in failure.known
        assert failure.said.startswith("found ") and ", expected " in failure.said


def test_a_failure_says_what_was_found(monkeypatch):
    known = self_test.answers()["composite"]["output 0"][0]
    with Spoilt("composite", lambda x: 2 * x):
        (failure,) = self_test.failures("cpu", ["composite"])
    assert failure.said == f"found {2 * known:.6g}, expected {known:.6g}"
    assert failure.known == "a weighted sum over its output 0"
    with Spoilt("composite", lambda x: x * math.nan):
        assert self_test.failures("cpu", ["composite"])[0].said == f"found nan, expected {known:.6g}"

    def refuse(*arguments):
        raise ValueError("composite: no\nkernel")

    monkeypatch.setattr(self_test.lib, "composite", refuse)
    assert self_test.failures("cpu", ["composite"])[0].said == "raised ValueError: composite: no kernel"


def test_the_test_makes_its_inputs_on_the_device(monkeypatch):
    with pretend_gpu(monkeypatch):
        assert self_test.failures("cuda") == []


@pytest.mark.skipif("cuda" not in devices.devices(), reason="no GPU that the kernels run on")
def test_the_operators_are_right_on_the_gpu():
    assert self_test.failures("cuda") == []


def test_all_is_well_here(capsys):
    assert main(["doctor"]) == DONE
    said = capsys.readouterr().out
    assert f"{len(self_test.answers())} operators, all as they should be" in said
    for name in "splitnerf, Python, torch, kernels, CUDA, ray tracing, texture coordinates, memory, disk".split(", "):
        assert f"\n{name} " in f"\n{said}"
    lines = [line for line in said.splitlines() if "->" not in line]
    assert all(line[23] == " " and line[24] != " " for line in lines)  # values stand below each other


def test_a_failed_check_ends_with_what_to_do(capsys, monkeypatch):
    monkeypatch.setattr(_core, "instruction_set", lambda: "avx512")
    with Spoilt("srgb_to_linear"):
        assert main(["doctor"]) == FAILED
    said = capsys.readouterr().out
    assert f"1 of {len(self_test.answers())} operators fail" in said
    known = self_test.answers()["srgb_to_linear"]["output 0"][0]
    assert f"  srgb_to_linear        found {1.01 * known:.3g}" in said
    assert f", expected {known:.6g} (a weighted sum over its output 0)" in said
    advice = [line.split("-> ")[1] for line in said.split("operators fail")[1].splitlines() if "-> " in line]
    assert "pip install --force-reinstall" in advice[0] and "SPLITNERF_ISA=avx2" in advice[1] and "report" in advice[2]


def test_libraries_that_cannot_be_loaded(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "splitnerf_tools.doctor.machine", None)
    assert main(["doctor"]) == FAILED
    assert "cannot be loaded" in (said := capsys.readouterr().out) and "-> install it again: pip install" in said


def test_threads(monkeypatch):
    monkeypatch.setattr(machine, "processors", lambda: 4)
    monkeypatch.setattr(torch, "get_num_threads", lambda: 2)
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    assert machine.threads().advice == ""  # two threads for each core are of no use
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    assert "OMP_NUM_THREADS=2 leaves processors idle" in machine.threads().advice
    monkeypatch.setattr(torch, "get_num_threads", lambda: 8)
    assert machine.threads().advice.endswith("set OMP_NUM_THREADS=4")


def test_processors_within_a_control_group(monkeypatch):
    monkeypatch.setattr(machine.os, "sched_getaffinity", lambda pid: set(range(8)), raising=False)
    for quota, count in (([], 8), (["max", "100000"], 8), (["250000", "100000"], 2), (["50000", "100000"], 1)):
        monkeypatch.setattr(machine, "control_group", lambda name, quota=quota: quota)
        assert machine.processors() == count


def test_kernels_below_the_processor(monkeypatch):
    monkeypatch.setattr(_core, "instruction_set", lambda: "avx2")
    monkeypatch.setattr(torch.backends.cpu, "get_cpu_capability", lambda: "AVX512")
    monkeypatch.setenv("SPLITNERF_ISA", "avx2")
    assert machine.kernels().advice == "SPLITNERF_ISA=avx2 chose them: unset it"
    monkeypatch.delenv("SPLITNERF_ISA")
    assert machine.kernels().value == "avx2, slower than this processor's avx512"
    assert "pip install" in machine.kernels().advice
    monkeypatch.setattr(torch.backends.cpu, "get_cpu_capability", lambda: "AVX2")
    assert machine.kernels().advice == "" and machine.lower_instruction_set() == "base"
    monkeypatch.setattr(_core, "instruction_set", lambda: "base")
    assert machine.lower_instruction_set() is None


@pytest.mark.parametrize(
    ("architectures", "covered", "others"),
    [
        ("90-real", [(9, 0)], [(10, 0)]),
        ("80-real, 90", [(8, 6), (12, 0)], [(7, 5)]),
        ("86-real", [], [(8, 0)]),
        ("80-virtual", [(8, 9)], [(7, 5)]),
        ("90a-real", [(9, 0)], []),
        ("100-real", [(10, 3)], []),
        ("", [], [(9, 0)]),
    ],
)
def test_which_gpus_kernels_run_on(architectures, covered, others):
    assert all(devices.covers(architectures, *capability) for capability in covered)
    assert not any(devices.covers(architectures, *capability) for capability in others)


@pytest.fixture
def gpu(monkeypatch):
    """A machine with a GPU that is right; the changes of the arguments make it otherwise."""

    def make(built="90-real", there=True, capability=(9, 0), failed=()):
        monkeypatch.setattr(_core, "cuda_architectures", lambda: built)
        monkeypatch.setattr(torch.cuda, "is_available", lambda: there)
        monkeypatch.setattr(torch.cuda, "get_device_capability", lambda: capability)
        monkeypatch.setattr(torch.cuda, "get_device_name", lambda: "Big GPU")
        monkeypatch.setattr(torch.cuda, "current_device", lambda: 0)
        tested = [self_test.Failure(name, "cuda", "found 1, expected 2", "it") for name in failed]
        monkeypatch.setattr(self_test, "failures", lambda device: tested if device == "cuda" else None)

    return make


def test_gpus(gpu, monkeypatch):
    """A GPU with and without kernels for it, none, and one that torch does not see."""
    gpu()
    found = machine.cuda()
    assert "kernels for 90-real" in found.value and "Big GPU" in found.value and not found.advice and not found.failed
    assert devices.devices() == ["cpu", "cuda"]
    monkeypatch.setattr(torch.cuda, "get_device_capability", lambda: (7, 5))
    assert machine.cuda().failed and machine.cuda().advice.endswith("CMAKE_CUDA_ARCHITECTURES=75")
    assert devices.devices() == ["cpu"]
    monkeypatch.setattr(_core, "cuda_architectures", lambda: "")
    assert not machine.cuda().failed and machine.cuda().advice.endswith("CMAKE_CUDA_ARCHITECTURES=75")
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    monkeypatch.setattr(torch.version, "cuda", None)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    assert machine.cuda().value == "no kernels; torch for the CPU; no GPU" and not machine.cuda().advice
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}")
    assert "install torch for CUDA" in machine.cuda().advice
    monkeypatch.setattr(torch.version, "cuda", "13.0")
    assert "newer driver" in machine.cuda().advice


def test_without_embree(monkeypatch):
    monkeypatch.setattr(_core, "embree_version", lambda: "")
    monkeypatch.setattr(machine, "find_spec", lambda name: name)
    assert not machine.ray_tracing().failed and "libembree-dev" in machine.ray_tracing().advice
    monkeypatch.setattr(machine, "find_spec", lambda name: None)
    assert machine.ray_tracing().failed and machine.ray_tracing().advice == "pip install embreex"


def test_one_processor(monkeypatch, tmp_path, capsys):
    """xatlas crashes there: a training is refused before it begins, and an export before its work is lost."""
    assert not machine.texture_coordinates().failed
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    assert machine.texture_coordinates().failed and "two or more" in machine.texture_coordinates().advice
    assert "has one processor" in refused(capsys, "train", tmp_path, "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()
    with pytest.raises(InputError, match="has one processor"):
        unwrap(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32), 64)


class TestChoice:
    """--device auto: a GPU that passed every operator's test, else the CPU; why is said."""

    def test_a_gpu_that_passes_is_taken(self, gpu):
        gpu()
        why = f"the Big GPU passes the test of {len(self_test.operators('cuda'))} operators"
        assert fit_device(failing_operators) == ("cuda", why)
        assert fit_device(None) == ("cuda", "the build has kernels for the Big GPU")

    @pytest.mark.parametrize(
        ("changes", "why"),
        [
            ({"built": ""}, "this build has no GPU kernels"),
            ({"there": False}, "torch finds no GPU"),
            ({"capability": (8, 6)}, "this build has no kernels for the Big GPU"),
            ({"failed": ["composite"]}, "the Big GPU fails the test of composite (splitnerf doctor)"),
            (
                {"failed": ["composite", "adamw_steps_", "sdf_field"]},
                "the Big GPU fails the test of composite and 2 more (splitnerf doctor)",
            ),
        ],
    )
    def test_else_the_cpu_is(self, gpu, changes, why):
        gpu(**changes)
        assert fit_device(failing_operators) == ("cpu", why)

    def test_the_command_says_which(self, gpu, capsys):
        gpu(failed=["composite"])
        assert device_for("auto", False) == "cpu" and device_for("cuda", False) == "cuda"
        assert device_for("cpu", True) == "cpu"
        assert "note: trains on the CPU: the Big GPU fails the test of composite" in capsys.readouterr().err
        gpu()
        assert device_for("auto", False) == "cuda"
        assert "note: trains on the GPU: the Big GPU passes" in capsys.readouterr().err
        assert device_for("auto", True) == "cpu"
        assert "note: trains on the CPU: no GPU repeats bits" in capsys.readouterr().err
        gpu(there=False)
        assert device_for("auto", False) == "cpu" and not capsys.readouterr().err
