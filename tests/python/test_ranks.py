"""One scene in two processes of torchrun, on the CPU: the same sums as in one, and an end for all."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import torch
from ranks_worker import CASES, trained
from tiny_runs import SMALL, as_options, lines_of

from splitnerf.data.dataset import load_dataset
from splitnerf.ops import totalled_gradient_losses, totalled_material_losses
from splitnerf.training.checkpoint import load_checkpoint
from splitnerf.training.losses import Terms
from splitnerf.training.ranks import ALONE

torchrun = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2"]
environment = os.environ | {"OMP_NUM_THREADS": "1"}


@pytest.fixture(scope="module")
def results(data, tmp_path_factory) -> dict[str, dict]:
    """What one process, and each of two, find of the same cases; the folders under "folder"."""
    folder, dataset = tmp_path_factory.mktemp("ranks"), load_dataset(data)
    found = {("one", case): trained(case, dataset, folder / "one" / case) for case in ("shared", "exposures")}
    for of in ("one", "two"):
        shutil.copytree(folder / "one" / "shared", folder / of / "resumed")
    found["one", "resumed"] = trained("shared", dataset, folder / "one" / "resumed", resume=True)
    worker = Path(__file__).with_name("ranks_worker.py")
    subprocess.run([*torchrun, str(worker), str(data), str(folder / "two")], check=True, env=environment, timeout=300)
    for case in (*CASES, "resumed"):
        for rank in (0, 1):
            found[rank, case] = torch.load(folder / "two" / f"{case}_{rank}.pt")
    return found | {"folder": folder}


def apart(a: dict[str, torch.Tensor], b: dict[str, torch.Tensor]) -> dict[str, float]:
    """The distance of tensors as shares of their length, by name."""
    assert a.keys() == b.keys()
    return {name: float((a[name] - b[name]).norm() / b[name].norm().clamp(min=1e-30)) for name in b}


@pytest.mark.parametrize("case", ["shared", "exposures", "resumed"])
def test_two_processes_find_the_gradients_and_losses_of_one(results, case):
    """With half of its rays each, of one scene, in each of six or eight steps: within them the light moves and a mesh is made."""
    two, one = results[0, case], results["one", case]
    assert max(apart(two["grads"], one["grads"]).values()) < 5e-6
    assert max(apart(two["parameters"], one["parameters"]).values()) < 1e-5
    ours, theirs = (lines_of(results["folder"] / of / case) for of in ("two", "one"))
    assert len(ours) == len(theirs) >= 6 and {line["rays"] for line in ours} == {128}
    for a, b in zip(ours, theirs):
        for name in b:
            if name.startswith("loss") or name in ("kept", "shaded", "samples_per_ray"):
                assert a[name] == pytest.approx(b[name], rel=1e-5, abs=1e-9), (a["step"], name)


def test_two_processes_learn_the_exposures_of_one(results):
    two, one = (results[of, "exposures"]["exposures"]["sums"] for of in (0, "one"))
    assert one[:, 3].min() > 0 and torch.allclose(two, one, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("case", [*CASES, "resumed"])
def test_parameters_are_the_same_bits_in_all_processes(results, case):
    """After 20 steps in the case "all", with every term of the loss and a thread that makes meshes; of one mesh, by the first."""
    first, second = results[0, case], results[1, case]
    assert case == "exposures" or len(first["mesh"]["faces"]) > 0
    for kind in first:
        different = [name for name in first[kind] if not torch.equal(first[kind][name], second[kind][name])]
        assert different == []


def test_one_process_goes_on_from_the_checkpoint_of_two(results, data, tmp_path):
    run = tmp_path / "run"
    shutil.copytree(results["folder"] / "two" / "shared", run)
    names = load_checkpoint(run / "checkpoint.pt")["model"]
    assert names and not any("module." in name for name in names)
    resumed = trained("shared", load_dataset(data), run, resume=True)
    assert max(apart(resumed["parameters"], results["one", "resumed"]["parameters"]).values()) < 1e-5


def test_all_processes_say_what_one_of_them_found(results):
    words = [(results["folder"] / "two" / f"words_{rank}.txt").read_text() for rank in (0, 1)]
    assert words[0] == words[1] and "rays' target (1 of" in words[0]


def test_means_over_two_parts_are_those_over_both():
    """Of points whose numbers and weights differ from part to part, with gradients."""
    g = torch.Generator().manual_seed(1)
    parts = []
    for n, m in ((40, 10), (25, 30)):
        field = torch.randn(n + m, 3, generator=g).requires_grad_()
        metallic = torch.rand(n, 1, generator=g).requires_grad_()
        weights, beside = torch.rand(n, generator=g), torch.randint(n, (m,), generator=g)
        parts.append((field, weights, beside, metallic, torch.rand(n, 3, generator=g)))

    def terms_of(field, weights, beside, metallic, albedo) -> Terms:
        terms = Terms()
        bends, weight = totalled_gradient_losses(field, weights, beside)
        terms.add({"eikonal": 3.0, "smoothness": 0.5}, bends, [len(field), weight])
        metals, weight = totalled_material_losses(albedo, metallic, weights)
        terms.add({"metal": 1.0, "binary": None, "dark": 2.0}, metals, [weight] * 3)
        terms.add({"prior": 0.3}, (metallic.mean() * 0 + 2.0).reshape(()))
        return terms

    fields, weights, beside, metallic, albedo = zip(*parts)
    sizes = [len(x) for x in weights]
    samples = [field[:n] for field, n in zip(fields, sizes)]
    whole = terms_of(
        torch.cat([*samples, *(field[n:] for field, n in zip(fields, sizes))]), torch.cat(weights),
        torch.cat([beside[0], beside[1] + sizes[0]]), torch.cat(metallic), torch.cat(albedo),
    )  # fmt: skip
    whole.backward()
    leaves = [*fields, *metallic]
    expected = [x.grad for x in leaves]
    for x in leaves:
        x.grad = None
    sent: list[torch.Tensor] = []
    for part in parts:
        terms_of(*part).share(lambda x: sent.append(x) or x, torch.ones(2))
    for part in parts:
        terms = terms_of(*part)
        assert terms.share(lambda x: sum(sent), torch.ones(2)).tolist() == [2.0, 2.0]
        assert {name: float(term.value) for name, term in terms.items()} == pytest.approx(
            {name: float(term.value) for name, term in whole.items()}, rel=1e-5
        )
        terms.backward()
    for x, wanted in zip(leaves, expected):
        assert torch.allclose(x.grad, wanted, rtol=1e-4, atol=1e-7)


def test_one_process_alone_asks_nobody():
    x = torch.ones(3)
    assert ALONE.part(x) is x and ALONE.whole(x) is x and ALONE.divided(len) is len and ALONE.divisible(17) == 17
    generator = torch.Generator()
    assert ALONE.own(generator, 1, 2) is generator and ALONE.stops(True, 0.0) and not ALONE.stops(False, 0.0)


def started(data: Path, run: Path, *options: str) -> subprocess.Popen:
    """torchrun of two processes, once they have made steps."""
    command = [*torchrun, "-m", "splitnerf.train", str(data), "--out", str(run), *as_options(SMALL), *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
    deadline = time.monotonic() + 200
    while not ((run / "metrics.jsonl").exists() and len((run / "metrics.jsonl").read_text().splitlines()) > 5):
        assert process.poll() is None and time.monotonic() < deadline, process.communicate()
        time.sleep(0.1)
    return process


def workers(process: subprocess.Popen) -> list[int]:
    """The processes that a torchrun has started, by rank."""
    found = {}
    for pid in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split():
        told = Path(f"/proc/{pid}/environ").read_bytes().decode().split("\0")
        found[next(pair for pair in told if pair.startswith("RANK="))] = int(pid)
    return [found[name] for name in sorted(found)]


def said(text: str) -> list[str]:
    """The lines that the program itself wrote, but for notes and progress."""
    return [line for line in text.splitlines() if line.startswith("splitnerf: ") and "splitnerf: note" not in line]


@pytest.mark.parametrize("victim", [0, 1])
def test_a_killed_process_ends_all_with_one_line(data, tmp_path, victim):
    process = started(data, tmp_path / "run", "--steps", "100000")
    ours = workers(process)
    os.kill(ours[victim], signal.SIGKILL)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 1 and not any(Path(f"/proc/{pid}").exists() for pid in ours)
    assert len(said(err)) == 1 and "most often because one has ended" in said(err)[0], err


@pytest.mark.parametrize("asked, by", [("torchrun", "SIGTERM"), ("torchrun", "SIGINT"), ("the second process", "SIGTERM")])
def test_a_request_to_stop_saves_a_checkpoint(data, tmp_path, asked, by):
    """After a step on which all agree, whoever is asked; Ctrl-C asks torchrun alone, whose processes have groups of their own."""
    run = tmp_path / "run"
    process = started(data, run, "--steps", "100000")
    os.kill(process.pid if asked == "torchrun" else workers(process)[1], signal.Signals[by])
    out, err = process.communicate(timeout=120)
    assert process.returncode == 1 and said(err) == [] and "--resume" in out, (out, err)
    step = load_checkpoint(run / "checkpoint.pt")["step"]
    assert step > 5 and step % 4 == 0 and len(lines_of(run)) >= 5


def test_the_first_process_delivers(data, tmp_path):
    """A run to its end, last stage included; then nothing is left to do."""
    run = tmp_path / "run"
    command = [*torchrun, "-m", "splitnerf.train", str(data), "--out", str(run), "--steps", "24", "--resume", "auto", *as_options(SMALL)]
    command += ["--set", "refinement_sweeps=1"]
    for _ in range(2):
        done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=300)
        assert done.returncode == 0 and said(done.stderr) == [], done.stderr
    assert "is finished" in done.stdout and len(lines_of(run)) == len({line["step"] for line in lines_of(run)})
    for name in ("mesh.glb", "environment.exr", "report.html", "evaluation.json"):
        assert (run / name).stat().st_size > 0


def test_a_term_that_one_process_has_no_points_for_is_that_of_the_other():
    """Its mean and its gradient count alone."""
    x = torch.tensor([3.0], requires_grad=True)
    sent = []
    for total in (0.0, 0.5):
        terms = Terms()
        terms.add({"occlusion": 2.0}, x.sum() if total else torch.zeros(()), [total])
        terms.share(lambda v: sent.append(v) or v, torch.zeros(1))
    terms.share(lambda v: sum(sent), torch.zeros(1))
    terms.backward()
    assert float(terms["occlusion"].value) == 3.0 and x.grad.item() == 2.0


def test_bad_input_is_said_once(data, tmp_path):
    command = [*torchrun, "-m", "splitnerf.train", str(tmp_path / "nowhere"), "--out", str(tmp_path / "run")]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=200)
    assert done.returncode == 1 and len(said(done.stderr)) == 1 and "nowhere" in said(done.stderr)[0], done.stderr
    assert not (tmp_path / "run").exists()
