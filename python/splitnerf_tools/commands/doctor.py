"""splitnerf doctor."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import splitnerf
from splitnerf.cli.common import DONE, FAILED

from splitnerf_tools.findings import show

INSTALL_AGAIN = "install it again: pip install --force-reinstall --no-deps --no-build-isolation ."


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "doctor",
        help="look at the machine and the installation, and test every operator",
        description="Prints versions, threads, instruction set, GPU, ray tracer, memory, disk and optional packages, "
        "tests every operator against what is known without it, and says what to do about each finding. Exit code 1: "
        "something failed.",
    )
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    try:
        from splitnerf_tools.doctor.machine import devices, findings
    except (ImportError, OSError) as error:  # of torch, or of the compiled libraries
        show("splitnerf", f"{splitnerf.__version__}, which cannot be loaded: {error}", [INSTALL_AGAIN])
        return FAILED
    failed = False
    for finding in findings(Path.cwd()):
        finding.show()
        failed |= finding.failed
    for device in devices():
        failed |= not self_test(device)
    return FAILED if failed else DONE


def self_test(device: str) -> bool:
    """Tests the operators on a device, prints what was found, and returns whether all is well."""
    from splitnerf_tools.doctor.machine import lower_instruction_set
    from splitnerf_tools.doctor.self_test import failures, operators

    tested, begin = operators(device), time.perf_counter()
    failed = failures(device)
    seconds = f"{time.perf_counter() - begin:.1f} s"
    name = f"self-test on {device}"
    if not failed:
        show(name, f"{len(tested)} operators, all as they should be ({seconds})")
        return True
    show(name, f"{len(failed)} of {len(tested)} operators fail ({seconds})")
    for failure in failed:
        show(f"  {failure.operator}", f"{failure.said} ({failure.known})")
    lower = lower_instruction_set()
    advice = [INSTALL_AGAIN]
    if lower and device == "cpu":
        advice.append(f"if that does not help, use other kernels: set SPLITNERF_ISA={lower}, and look again")
    show("", "results are wrong here:", [*advice, "report it, with all that is printed here"])
    return False
