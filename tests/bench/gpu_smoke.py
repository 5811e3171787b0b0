"""Tries every operator on a GPU, each family of them in a process of its own, so that a kernel that fails takes no other with it.

    python tests/bench/gpu_smoke.py [--device cuda] [--only fields ...] [--seconds 60] [--under COMMAND ...]

A family is a file of splitnerf's doctor/checks. An operator is held against what is known without it, and against the CPU in
float64 with the inputs of its test. Launches are blocking, so an error is that of the operator that it is reported for. --under
and all behind it is put before each process, for instance compute-sanitizer and its options; then the tool's summary is a part of
the line. The last line counts; exit code 1: a family failed.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1] / "python")]


def families(device: str) -> dict[str, list[str]]:
    """The operators that run on a device, by family."""
    from splitnerf_tools.doctor.self_test import operators
    from splitnerf_tools.doctor.table import CHECKS

    found: dict[str, list[str]] = {}
    for name in operators(device):
        found.setdefault(CHECKS[name].__module__.rpartition(".")[2], []).append(name)
    return found


def wrong_with(op: str, device: str) -> list[str]:
    """What is wrong with an operator, a sentence each."""
    import torch
    from op_cases import CASES, check_against_the_cpu, moved
    from op_checks import lib

    from splitnerf_tools.doctor.self_test import failures

    said = [f"{op}: {failure.said} ({failure.known})" for failure in failures(device, [op])]
    for dtype in (torch.float64, torch.float32) if op in CASES else ():
        try:
            if op == "sample_rays" and dtype == torch.float32:  # roundings decide which samples are kept: it only runs
                getattr(lib, op)(*moved(op, CASES[op](dtype), device))
            else:
                check_against_the_cpu(op, dtype, device)
        except Exception as error:  # whatever it is, it is reported, and the next operator is tried
            said.append(f"{op}, {dtype}: {type(error).__name__}: {' '.join(str(error).split())[:300]}")
    return said


def try_here(family: str, device: str) -> int:
    """Tries the operators of a family in this process; prints what is wrong, and a last line."""
    names = families(device)[family]
    wrong = 0
    for name in names:
        for said in (found := wrong_with(name, device)):
            print(f"wrong: {said}", flush=True)
        wrong += bool(found)
    print(f"{len(names) - wrong} of {len(names)} operators agree", flush=True)
    return 1 if wrong else 0


def try_apart(family: str, args: argparse.Namespace) -> tuple[int, str]:
    """Tries a family in a process; its exit code and its lines, the last one first."""
    command = [*args.under, sys.executable, __file__, "--device", args.device, "--here", family]
    blocking = os.environ | {"CUDA_LAUNCH_BLOCKING": "1", "PYTORCH_NO_CUDA_MEMORY_CACHING": "1"}
    try:
        done = subprocess.run(
            command, env=blocking, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=args.seconds
        )
        code, text = done.returncode, done.stdout
    except subprocess.TimeoutExpired as stopped:
        code, text = 124, (stopped.stdout or b"").decode(errors="replace") + f"\nstopped after {args.seconds:.0f} s"
    lines = [line.strip() for line in text.splitlines() if line.strip()] or ["said nothing"]
    summaries = [line.lstrip("= ") for line in lines if "SUMMARY" in line] if args.under else []
    last = next((line for line in reversed(lines) if "operators agree" in line), lines[-1])
    verdict = "" if code == 0 else f"failed ({code}): "
    shown = [f"  {line[:400]}" for line in lines[-40:]] if code else []
    return code, "\n".join([f"{family}: {verdict}{'; '.join([last, *summaries])}", *shown])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--device", choices=["cuda", "cpu"], default="cuda")
    parser.add_argument("--only", action="append", default=[], metavar="FAMILY")
    parser.add_argument("--seconds", type=float, default=60.0, help="that a process may take (default: 60)")
    parser.add_argument("--jobs", type=int, default=4, help="processes at a time (default: 4)")
    parser.add_argument("--here", metavar="FAMILY", help=argparse.SUPPRESS)  # a process of its own has begun
    parser.add_argument("--under", nargs=argparse.REMAINDER, default=[], metavar="COMMAND")
    args = parser.parse_args()
    if args.here is not None:
        return try_here(args.here, args.device)
    names = args.only or list(families(args.device))
    failed = 0
    with ThreadPoolExecutor(args.jobs) as pool:
        for code, lines in pool.map(lambda name: try_apart(name, args), names):
            print(lines, flush=True)
            failed += code != 0
    print(f"{len(names)} families, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
