"""The page of a run, served while the run trains."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from splitnerf_tools.view.live import Live
from splitnerf_tools.view.server import ViewServer

POLL = 0.1  # seconds between the server's checks for its end


@contextmanager
def training_page(name: str, port: int) -> Iterator[Live]:
    """Serves the page of a run within the block, prints its address, and sends the page how the run ended. It listens at 127.0.0.1;
    port 0 takes a free one. Raises InputError where the port cannot be used."""
    live = Live(name)
    with ViewServer(live.shown, port=port, live=live) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": POLL}, daemon=True)
        thread.start()
        print(server.url, flush=True)
        try:
            yield live
        except BaseException:
            live.events.end("the command ended before the run was done; see the terminal for the reason")
            raise
        else:
            live.events.end(ending(live))
        finally:
            server.shutdown()
            thread.join()


def ending(live: Live) -> str:
    """One line for the page at the end of a command."""
    if live.events.state["stage"] == "evaluation":
        return "the run is done and the command has ended; this page keeps what it has loaded"
    return "the command was interrupted and has kept its state; train --resume continues, with a new address"
