"""Pages of docs/benchmarks on single operators: what they cost against plain torch, and what the split sum costs in error.

python tests/bench/operators.py [hash_grid|shading|split_sum] [--quick] [--out docs/benchmarks]
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
NAMES = ("hash_grid", "shading", "split_sum")


def main() -> None:
    from splitnerf_tools.bench.harness import run_benchmarks

    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("name", nargs="?", choices=NAMES, help="default: all")
    parser.add_argument("--quick", action="store_true", help="small inputs and few rounds")
    parser.add_argument("--out", type=Path, default=Path("docs/benchmarks"))
    args = parser.parse_args()
    modules = [f"bench.{name}" for name in ([args.name] if args.name else NAMES)]
    for path in run_benchmarks(modules, args.quick, args.out, print):
        print(path)


if __name__ == "__main__":
    main()
