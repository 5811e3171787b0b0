"""splitnerf inspect."""

from __future__ import annotations

import argparse
from pathlib import Path

from splitnerf.cli.common import DONE, add_reading_options, examples, reading_of
from splitnerf.errors import InputError

PAGE = "inspect.html"


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "inspect",
        help="look at data before training: cameras, masks, exposures, and what may be wrong",
        description="Prints what DATA hold and what to do about what is suspected: cameras in the object or on one "
        "side of it, masks that disagree with the poses, a moved object, duplicate photos, differing brightness, cut, "
        "small or clipped objects. Draws it, with all masks over their photos, on a page. Exit code 2: DATA cannot be read.",
        epilog=examples("splitnerf inspect data", "splitnerf inspect data --out looks.html"),
    )
    parser.add_argument("data", type=Path, metavar="DATA", help="folder of photographs with cameras")
    parser.add_argument(
        "--out",
        type=Path,
        default=Path(PAGE),
        metavar="PAGE",
        help=f"the page to write, or a folder for it (default: {PAGE})",
    )
    parser.add_argument("--downscale", type=int, default=1, metavar="N", help="average images down by N (default: 1)")
    add_reading_options(parser, "as the data say")
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    from splitnerf.files import refuse_others
    from splitnerf.pipeline import load_splits

    from splitnerf_tools.inspection.checks import inspect
    from splitnerf_tools.inspection.inspect_page import write_page

    page = args.out / PAGE if args.out.is_dir() else args.out
    if page.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"{page}: is not a page; give --out a name that ends in .html, or a folder")
    refuse_others(page, b"inspected data</title>")
    reading = reading_of(args, args.data)
    found = inspect(*load_splits(args.data, args.downscale, reading), reading)
    for finding in found.findings:
        finding.show()
    write_page(page, found)
    print(f"look at {page}")
    return DONE
