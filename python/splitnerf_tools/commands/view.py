"""splitnerf view."""

from __future__ import annotations

import argparse
import os
import sys
from contextlib import suppress
from pathlib import Path

from splitnerf.cli.common import DONE, examples
from splitnerf.errors import InputError

LOCAL = "127.0.0.1"


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "view",
        help="look at an asset in the browser",
        description="Serves a page that shows RUN's mesh.glb, or a GLB file, in the light that the run recovered, and its "
        "maps. Other lights (.hdr, .exr) can be dropped onto the page. Ctrl-C ends it.",
        epilog=examples("splitnerf view runs/data", "splitnerf view runs/a runs/b --light studio.hdr"),
    )
    add = parser.add_argument
    add("source", type=Path, metavar="RUN|FILE.glb", help="a run's folder or a .glb")
    add(
        "other", type=Path, nargs="?", metavar="OTHER", help="a second one, shown beside the first with the same camera"
    )
    add("--light", type=Path, metavar="MAP", help="the .exr or .hdr, or built-in light, that is shown first")
    add("--data", type=Path, metavar="DATA", help="the data whose cameras and photos are shown (default: RUN's)")
    add("--port", type=int, default=0, metavar="N", help="of the page's address (default: a free one)")
    add(
        "--host",
        default=LOCAL,
        metavar="H",
        help=f"the address to listen at; another than {LOCAL} lets other machines in",
    )
    add("--no-browser", action="store_true", help="print the address only")
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    import webbrowser

    from splitnerf.run_folder import data_of

    from splitnerf_tools.view.assets import ViewedAssets, ViewedPhotos
    from splitnerf_tools.view.server import ViewServer

    if not 0 <= args.port < 1 << 16:
        raise InputError(f"--port must lie between 0 and 65535, got {args.port}")
    shown = ViewedAssets([args.source] + ([args.other] if args.other else []), args.light)
    remembered = data_of(args.source) if args.source.is_dir() else None
    data = args.data or (remembered and remembered[0])
    photos = ViewedPhotos(data) if data else None
    with ViewServer(shown, photos, args.host, args.port) as server, suppress(KeyboardInterrupt):  # the way to end it
        if args.host != LOCAL:
            print(f"splitnerf: note: listens at {args.host}: whoever knows the address below can look", file=sys.stderr)
        print(server.url, flush=True)
        # Only where there is a desktop: on a terminal alone, a text browser would take it over.
        desktop = sys.platform == "darwin" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
        if desktop and not args.no_browser:
            webbrowser.open(server.url)
        server.serve_forever()
    return DONE
