"""What each process of tests/python/test_ranks.py does: `ranks_worker.py DATA FOLDER`, started by torchrun.

It leaves in FOLDER, for each case, the gradients of the first step and the parameters after the last, of each process.
"""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import torch
from tiny_runs import tiny

from splitnerf.config import Config
from splitnerf.data.dataset import Dataset, load_dataset
from splitnerf.training import meshes
from splitnerf.training import ranks as ranks_module
from splitnerf.training.batches import Batch
from splitnerf.training.finite import Diverged
from splitnerf.training.loop import Training
from splitnerf.training.ranks import ALONE, Alone, joined

# Every term whose points are not a choice among those of one process: the sum is then that of one process.
SHARED = {
    "normal_smoothness": 0.0, "priors_from": 1.0, "foreground_share": 0.6, "hull_until": 0.0, "open_below": 0.0, "grid_every": 4,
}  # fmt: skip
CASES = {
    "shared": SHARED | {"steps": 20, "mesh_every": 0.15},
    "exposures": SHARED | {"steps": 200, "exposure_refine": "yes"},
    "all": {
        "steps": 20, "mesh_every": 0.2, "priors_from": 0.2, "open_below": 0.0, "indirect_every": 4, "grid_every": 3,
        "background_meshes": True,
    },
    "mlp": {"steps": 8, "mesh_every": 0.2, "occlusion": "mlp", "light": "mlp", "shading": "split", "sparse_steps": True},
}  # fmt: skip
N_STEPS = {"shared": 6, "exposures": 8}


def settings(case: str) -> Config:
    many = {"initial_rays": 128, "max_rays": 128, "target_samples": 1 << 16}  # so that the number of rays stays even
    return tiny(**many | CASES[case])


def steps(training: Training, n: int) -> dict[str, dict[str, torch.Tensor]]:
    """Makes n steps; returns the gradients of the first, and the parameters, the photos' exposures and the mesh after the last."""
    grads = {}
    for i in range(n):
        training.ranks.stops(False, training.started)
        training.refresh()
        training.advance(SimpleNamespace(show=lambda *_: None))
        if i == 0:
            grads = {name: p.grad.clone() for name, p in training.model.named_parameters() if p.grad is not None}
    parameters = {name: p.detach().clone() for name, p in training.model.named_parameters()}
    training.mesh.poll(wait=True)
    mesh = training.mesh.current
    surface = {} if mesh is None else {"vertices": mesh.vertices, "faces": mesh.faces}
    surface |= {"bits": mesh.bits.cache.bits} if mesh and mesh.bits else {}
    return {"grads": grads, "parameters": parameters, "exposures": {"sums": training.exposures.sums}, "mesh": surface}


def trained(case: str, dataset: Dataset, run: Path, ranks: Alone = ALONE, resume: bool = False) -> dict:
    run.mkdir(exist_ok=True, parents=True)
    training = Training(dataset, settings(case), run, torch.device("cpu"), ranks=ranks)
    if resume:
        training.restore()
    torch.rand(ranks.rank)  # the grid's random numbers are those of the first process all the same
    result = steps(training, N_STEPS.get(case, settings(case).run.steps))
    training.save()
    return result


def refuse(*_: object) -> None:
    raise AssertionError("another process than the first one makes a mesh")


def words_of_a_bad_ray(dataset: Dataset, run: Path, ranks: Alone) -> str:
    """What each process says where a photo's value in the last one's rays is not a number."""
    run.mkdir()
    training = Training(dataset, settings("shared"), run, torch.device("cpu"), ranks=ranks)
    part = ranks.part

    def bad(batch: Batch) -> Batch:
        mine = part(batch)
        if ranks.rank == ranks.size - 1:
            mine.target[0, 0] = float("nan")
        return mine

    ranks.part = bad
    try:
        steps(training, 1)
    except Diverged as error:
        return str(error)
    finally:
        ranks.part = part
    return ""


def main() -> None:
    dataset, folder = load_dataset(Path(sys.argv[1])), Path(sys.argv[2])
    ranks_module.LARGE = 1 << 10  # so that the tiny table is summed where it lies
    with joined() as ranks:
        if not ranks.is_first:
            meshes.make_mesh = meshes.make_beside = refuse
        for case in CASES:
            torch.save(trained(case, dataset, folder / case, ranks), folder / f"{case}_{ranks.rank}.pt")
        resumed = trained("shared", dataset, folder / "resumed", ranks, resume=True)
        torch.save(resumed, folder / f"resumed_{ranks.rank}.pt")
        (folder / f"words_{ranks.rank}.txt").write_text(words_of_a_bad_ray(dataset, folder / f"bad_{ranks.rank}", ranks))
        ranks.leave()


if __name__ == "__main__":
    main()
