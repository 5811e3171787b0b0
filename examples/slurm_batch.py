"""Many scenes on a cluster with Slurm: one job of an array for each, through submitit (pip install submitit).

    python examples/slurm_batch.py scenes/* --out runs/all --partition gpu -- --max-minutes 30

What stands behind ``--`` goes to each `splitnerf train`. A job that Slurm ends before its time, or at its time limit, saves
its state and is queued again. The same command goes on where scenes are not finished. Try it without Slurm by --cluster local.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

import submitit


class Training:
    """`splitnerf train` as a job; Slurm's warning of its end saves the state, and the job is queued again."""

    def __call__(self, scene: str, run: str, options: list[str]) -> int:
        command = [sys.executable, "-m", "splitnerf", "train", scene, "--out", run, "--resume", "auto", *options]
        self.process = subprocess.Popen(command)
        return self.process.wait()

    def checkpoint(self, scene: str, run: str, options: list[str]) -> submitit.helpers.DelayedSubmission:
        self.process.terminate()
        os.waitid(os.P_PID, self.process.pid, os.WEXITED | os.WNOWAIT)  # wait() would wait for the call above
        return submitit.helpers.DelayedSubmission(Training(), scene, run, options)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scenes", type=Path, nargs="+", help="folders of posed images, each of another name")
    parser.add_argument("--out", type=Path, required=True, help="folder of the runs, which all machines see")
    parser.add_argument("--cluster", choices=["slurm", "local"], default="slurm")
    parser.add_argument("--partition", help="Slurm's partition")
    parser.add_argument("--hours", type=float, default=4.0, help="time limit of a job (default: 4)")
    parser.add_argument("--cores", type=int, default=2, help="of a job (default: 2)")
    parser.add_argument("--gpus", type=int, default=0, help="of a job (default: 0)")
    parser.add_argument("--memory", type=int, default=4, help="GB of a job (default: 4)")
    parser.add_argument("--at-once", type=int, default=100, help="most jobs at a time (default: 100)")
    words = sys.argv[1:]
    at = words.index("--") if "--" in words else len(words)
    args, options = parser.parse_args(words[:at]), words[at + 1 :]

    scenes = {scene.resolve().name: scene.resolve() for scene in args.scenes}
    if len(scenes) < len(args.scenes):
        parser.error("two scenes have the same name")
    if ".jobs" in scenes:
        parser.error("a scene is called .jobs, as the folder of the jobs is; give it another name")
    executor = submitit.AutoExecutor(args.out / ".jobs", cluster=args.cluster)
    executor.update_parameters(
        timeout_min=round(60 * args.hours),
        cpus_per_task=args.cores,
        mem_gb=args.memory,
        gpus_per_node=args.gpus,
        slurm_array_parallelism=args.at_once,
        slurm_partition=args.partition,
        slurm_job_name="splitnerf",
    )
    runs = [str((args.out / name).absolute()) for name in scenes]
    jobs = executor.map_array(Training(), list(map(str, scenes.values())), runs, [options] * len(runs))
    failed = 0
    for name, job in zip(scenes, jobs):
        try:
            code = job.result()
        except Exception as error:  # the job itself failed: out of memory, or cancelled
            code = str(error).strip().splitlines()[-1]
        failed += code != 0
        print(f"{name}: {'done' if code == 0 else f'failed ({code}), see {job.paths.stderr}'}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
