"""How near the costliest kernels of a training come to the card's limits, as Nsight Compute counts.

    python tests/bench/gpu_limits.py PROFILE.md --out DIR -- COMMAND ...

PROFILE.md is a profile of gpu_train.py: it says which eight of our kernels cost most. COMMAND trains; ncu counts some launches of
these kernels in it and ends it. Writes limits.md: the time of a launch, and shares of what the card can do in that time. The
larger share, of arithmetic or of memory, is how far the kernel is from its limit; warps say how full the card is.
"""

from __future__ import annotations

import argparse
import csv
import re
import statistics
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
METRICS = {  # as ncu names them, and as the page does
    "gpu__time_duration.sum": "us",
    "sm__throughput.avg.pct_of_peak_sustained_elapsed": "arithmetic, %",
    "gpu__compute_memory_throughput.avg.pct_of_peak_sustained_elapsed": "memory with its caches, %",
    "dram__throughput.avg.pct_of_peak_sustained_elapsed": "DRAM, %",
    "sm__warps_active.avg.pct_of_peak_sustained_active": "warps, %",
}
COSTLIEST = 8
SKIPPED, COUNTED = 240, 64  # launches of these kernels: some 30 steps, then 8
IN_US = {"ns": 1e-3, "nsecond": 1e-3, "us": 1.0, "usecond": 1.0, "ms": 1e3, "msecond": 1e3}


def costliest(profile: str) -> list[str]:
    """The names of our kernels in a profile, the costliest first: a body's where a launcher runs it."""
    sources = "".join(path.read_text() for folder in ("cuda", "include") for path in sorted((ROOT / "cpp" / folder).rglob("*.*")))
    found: list[str] = []
    for line in re.findall(r"^\|.*\| `([^`]+)` \|$", profile, re.MULTILINE):
        match = re.match(r"(?:for_each\w*_kernel<)?(\w+(?:Body|_kernel))\b(?!::)", line)
        if match and match[1] not in found and re.search(rf"\b{match[1]}\b", sources):
            found.append(match[1])
    return found[:COSTLIEST]


def counted(text: str, names: list[str]) -> dict[str, dict[str, float]]:
    """The medians of ncu's lines, by kernel and metric; kernels that it did not see are left out."""
    lines = [line for line in text.splitlines() if line.startswith('"')]
    reader = csv.DictReader(lines)
    values: dict[str, dict[str, list[float]]] = {}
    units: dict[str, str] = {}
    for row in reader:
        if not row["ID"]:  # the line of units
            units = row
            continue
        name = next((name for name in names if re.search(rf"\b{name}\b", row["Kernel Name"])), None)
        for metric in METRICS if name else ():
            scale = IN_US[units[metric]] if metric == "gpu__time_duration.sum" else 1.0
            number = float(row[metric].replace(",", "")) * scale
            values.setdefault(name, {}).setdefault(metric, []).append(number)
    return {name: {metric: statistics.median(x) for metric, x in of.items()} for name, of in values.items()}


def page(found: dict[str, dict[str, float]], names: list[str]) -> str:
    lines = ["# The costliest kernels against the card's limits", "", "Medians of single launches, counted by Nsight Compute.", "",
             "| kernel | " + " | ".join(METRICS.values()) + " |", "|---|" + "---|" * len(METRICS)]  # fmt: skip
    for name in names:
        cells = [f"{found[name][metric]:.1f}" for metric in METRICS] if name in found else ["not seen"] + [""] * (len(METRICS) - 1)
        lines.append(f"| `{name}` | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def sentence(found: dict[str, dict[str, float]]) -> str:
    """What a table says: the nearer of the two limits of each kernel."""
    arithmetic, memory = list(METRICS)[1:3]
    return "share of the limit: " + ", ".join(f"{name} {max(x[arithmetic], x[memory]):.0f} %" for name, x in found.items())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("profile", type=Path, metavar="PROFILE.md")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("command", nargs="+", metavar="COMMAND")
    args = parser.parse_args()
    names = costliest(args.profile.read_text())
    if not names:
        print(f"{args.profile} names none of our kernels", file=sys.stderr)
        return 1
    log = args.out / "limits.csv"
    ncu = ["ncu", "--csv", "--page", "raw", "--log-file", str(log), "--force-overwrite", "--kernel-name-base", "demangled",
           "--kernel-name", f"regex:{'|'.join(names)}", "--metrics", ",".join(METRICS), "--launch-skip", str(SKIPPED),
           "--launch-count", str(COUNTED), "--kill", "yes", "--target-processes", "all"]  # fmt: skip
    done = subprocess.run([*ncu, *args.command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    text = log.read_text() if log.is_file() else ""
    found = counted(text, names)
    if not found:
        print("\n".join([*done.stdout.splitlines()[-20:], *text.splitlines()[-5:], f"ncu counted nothing ({done.returncode})"]))
        return 1
    (args.out / "limits.md").write_text(page(found, names))
    print(sentence(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
