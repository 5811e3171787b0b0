"""splitnerf info."""

from __future__ import annotations

import argparse

import splitnerf
from splitnerf.cli.exit_codes import DONE


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser("info", help="show versions, the build, and the settings of a preset")
    parser.add_argument(
        "--settings",
        metavar="PRESET",
        nargs="?",
        const="cpu",
        help="print every setting of a preset: its value, unit, range and meaning (default: cpu)",
    )
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    import torch

    from splitnerf import _core
    from splitnerf.config import preset, settings_table

    if args.settings:
        print(settings_table(preset(args.settings)))
        return DONE
    print(f"splitnerf {splitnerf.__version__}")
    print(f"torch {torch.__version__}, {torch.get_num_threads()} threads")
    print(f"kernels: {_core.instruction_set()}")
    architectures = _core.cuda_architectures()
    print(f"CUDA kernels: {architectures or 'none (build without CUDA)'}")
    print(
        f"ray tracing: {'Embree ' + _core.embree_version() if _core.embree_version() else 'embreex (build without Embree)'}"
    )
    return DONE
