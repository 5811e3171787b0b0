"""Shared by the commands: exit codes, the format of their help, options that read data, and printed scores."""

from __future__ import annotations

import argparse
import resource
import sys
import time
from collections.abc import Iterable, Mapping
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, NoReturn

from splitnerf.errors import plain
from splitnerf.memory import memory_bytes

if TYPE_CHECKING:
    from splitnerf.data.reading import Reading
    from splitnerf.training.observer import Event

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
TITLE = "examples:"
FEW = 4  # choices, which are all named


def examples(*lines: str, after: str = "") -> str:
    """The end of a command's help: command lines to copy, after a paragraph."""
    return "\n".join(([after, ""] if after else []) + [TITLE, *(f"  {line}" for line in lines)])


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line and name what was meant; options are not abbreviated, as a later one may begin
    with the same letters."""

    def __init__(self, **options: object):
        super().__init__(allow_abbrev=False, **options)

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"splitnerf: {plain(message)} (see `{self.prog} --help`)\n")

    def refuse_unknown(self, words: list[str]) -> None:
        """Ends the program where words are left over."""
        if words:
            self.error(f"unknown {words[0]!r}{meant(words[0].partition('=')[0], self._option_string_actions)}")

    def _check_value(self, action: argparse.Action, value: object) -> None:
        if action.choices is not None and value not in action.choices:
            choices = list(map(str, action.choices))
            near = meant(str(value), choices) if len(choices) > FEW else ""
            hint = near or f"; there are {', '.join(choices)}"
            raise argparse.ArgumentError(action, f"unknown {str(value)!r}{hint}")


def commands_of(parser: argparse.ArgumentParser) -> dict[str, Parser]:
    """A parser's commands by their names."""
    found = (action.choices for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    return next(found, {})


def meant(word: str, known: Iterable[str]) -> str:
    """A question for the nearest known word; "" where none is near."""
    near = get_close_matches(word, list(known), 1)
    return f"; did you mean {near[0]}?" if near else ""


class Help(argparse.HelpFormatter):
    """Wraps paragraphs, but leaves examples as they are."""

    def __init__(self, prog: str):
        super().__init__(prog, max_help_position=28)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        paragraph, title, lines = text.partition(TITLE)
        filled = super()._fill_text(paragraph, width, indent) if paragraph.strip() else ""
        return "\n\n".join(part for part in (filled, title + lines if title else "") if part)


class ProgramHelp(Help):
    """The help of the program: a title stands above each group of commands, `groups` names it by the group's first
    command."""

    def __init__(self, prog: str, groups: Mapping[str, str]):
        super().__init__(prog)
        self._groups = groups

    def _format_action(self, action: argparse.Action) -> str:
        text, title = super()._format_action(action), self._groups.get(action.dest)
        return f"{'':{self._current_indent - 2}}{title}:\n{text}" if title else text


def add_reading_options(parser: argparse.ArgumentParser, default: str = "as the data state or suggest") -> None:
    """Adds --eval-mode, --mask-kind and --max-memory; `default` is the help text of the first two's default."""
    parser.add_argument(
        "--eval-mode",
        choices=["all", "fraction", "filename"],
        help="what of the data is for testing: fraction, every 8th view; filename, the views with `test` or `eval` in "
        f"their path, those with `train` train; all, no view is held out and all are evaluated (default: {default})",
    )
    parser.add_argument(
        "--mask-kind",
        choices=["object", "ignore"],
        help="what mask files mean: object, white is the object; ignore, black is to be ignored and alpha is the "
        f"object (default: {default})",
    )
    parser.add_argument(
        "--max-memory",
        type=float,
        metavar="GB",
        help="memory for photos; more are read from a file in TMPDIR (default: half of what is available)",
    )


def reading_options(args: argparse.Namespace) -> dict[str, object]:
    """The settings that the options give, by name."""
    given = {"data.eval_mode": args.eval_mode, "data.mask_kind": args.mask_kind, "data.max_memory": args.max_memory}
    return {name: value for name, value in given.items() if value is not None}


def reading_of(args: argparse.Namespace, target: Path) -> Reading:
    """How to read data: by the options, else as in the run that `target` is or belongs to, else by default."""
    from splitnerf.config import Config
    from splitnerf.data.reading import SEPARATED, is_separated

    run = next((f for f in (target, *target.absolute().parents[:2]) if (f / "checkpoint.pt").is_file()), None)
    config = Config() if run is None or not (run / "config.toml").is_file() else Config.read(run / "config.toml")
    reading = config.replace(reading_options(args)).reading
    return replace(reading, separated=run / SEPARATED) if run is not None and is_separated(run / SEPARATED) else reading


class Stages:
    """An observer that says which stage of a run begins, what ends it, how long it still takes, and where the results go."""

    def __init__(self) -> None:
        self._names, self._started, self._end = ["training"], time.monotonic(), 0.0

    def __call__(self, event: Event) -> None:
        if event.kind == "begun":
            import torch

            training, run, n = event.training, event.training.config.run, torch.get_num_threads()
            refinement = ["refinement"] if training.config.refinement.enabled else []
            self._names = ["training", "export", *refinement, "evaluation"]
            self._end = training.started + 60 * run.max_minutes
            cpu = f"{n} thread{'s' * (n > 1)} of the CPU"
            total, free = (f"{size / 1e9:.3g}" for size in memory_bytes())
            where = f"{cpu if training.model.device.type == 'cpu' else 'the GPU'}, {free} of {total} GB of memory free"
            limit = f"{run.max_minutes:.3g} minute{'s' * (run.max_minutes != 1)}, export and scores aside"
            ends = limit if run.max_minutes else f"{run.steps} steps"
            if not training.finished:
                self._say("training", f" on {where}; in all {ends}; results go to {plain(str(training.run))}")
        elif event.kind in self._names:
            now = time.monotonic()
            spent, left = round(now - self._started), max(0, round(self._end - now))
            words, clock = "{} minutes", "{}:{:02d}".format
            if left:
                words = "{} of {} minutes" if event.kind == "evaluation" else "{} minutes and {} to come"
            rest = spent + left if event.kind == "evaluation" else left
            self._say(event.kind, ", after " + words.format(*(clock(*divmod(x, 60)) for x in (spent, rest))))

    def _say(self, name: str, more: str) -> None:
        print(f"stage {self._names.index(name) + 1} of {len(self._names)}: {name}{more}", file=sys.stderr, flush=True)


def print_summary(run: Path, evaluation: dict, step: int, seconds: float, device: str = "cpu") -> None:
    """Prints the steps, the device and the memory, the errors against the truth in the data, and the path of the
    results."""
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1024 if sys.platform == "linux" else 1)
    processor = "CPU" if device == "cpu" else "GPU"
    print(f"{step} steps in {seconds:.0f} s on the {processor}, {used / 1e9:.1f} GB of memory")
    print_refinement(evaluation.get("refinement"))
    print_scores(evaluation)
    print(f"results: {run / 'report.html'}, {run / 'mesh.glb'}, {run / 'environment.exr'}")
    name, relit = (quote(str(path)) for path in (run, run / "relit"))
    print(f"look at it: splitnerf view {name}")
    print(f"in another light: splitnerf relight {name} --env studio --turntable 60 --gif --out {relit}")


def print_refinement(summary: dict | None) -> None:
    """A line with the changes by the refinement, if there was one."""
    from splitnerf.refinement.level import evidence

    if summary is None:
        return
    psnr = "{} {:.2f} -> {:.2f} dB".format
    changes = [psnr("colours", *summary["photos_psnr"]), psnr("of photos held out", *summary["held_out_psnr"])]
    if summary["outline_error"]:
        changes.append("coverage at the outline, squared error {:.2g} -> {:.2g}".format(*summary["outline_error"]))
    print(f"refinement, on the photos: {', '.join(changes)}, at step {summary['steps']}, {summary['seconds']:.0f} s")
    before, after = summary["held_out_psnr"]
    if after < before and summary["delivered"] and not summary["lamp"]:
        print(
            "photos held out lose what training had fitted in them; new views of objects with truth lost nothing by that"
        )
    if summary["lamp"]:
        print("a lamp that training had smeared was made compact first; photos do not tell which of the two it was")
    for told in evidence(summary["level"], summary["tint"]):
        print(told)
    if summary["delivered"] == 0:
        print("no step helped the photos held out: the asset keeps the textures and the light from before the steps")
    if summary["detail"]:
        print("the albedo has detail as fine as the photos show it, in {0} x {0} texels".format(summary["detail"]))
    if not summary["normal_texture"]:
        print("no normal texture is delivered: the photos held out fit the mesh's own normals as well")


def print_scores(evaluation: dict) -> None:
    """A line for each score, after its free scale if it has one, with what it means in a word."""
    from splitnerf.evaluate.score_table import graded

    words = {row["place"][0]: f" ({row['word']})" for row in graded(evaluation)}
    for name, key in (("novel views", "novel_view"), ("relit views", "relight"), ("albedo", "albedo")):
        if scores := evaluation.get(key):
            lpips = "" if scores["lpips"] is None else f", LPIPS {scores['lpips']:.4f}"
            print(f"{name:22s} PSNR {scores['psnr']:.2f} dB, SSIM {scores['ssim']:.4f}{lpips}{words[key]}")
    for name, key, unit in (
        ("normals, mean angle", "normal_mae_deg", " degrees"),
        ("roughness, mean error", "roughness_mae", ""),
        ("metallic, bal. accuracy", "metallic_balanced_accuracy", ""),
        ("light PSNR", "light_psnr", " dB"),
        ("mesh chamfer", "chamfer", ""),
        ("mesh F-score", "f_score", ""),
    ):
        if evaluation.get(key) is not None:
            print(f"{name:22s} {evaluation[key]:.4g}{unit}{words.get(key, '')}")
