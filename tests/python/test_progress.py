"""What a long run shows of its progress, and how Ctrl-C reaches it."""

from __future__ import annotations

import io
import signal

import pytest
from splitnerf import progress
from splitnerf.progress import Interrupt, Progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock(monkeypatch) -> list[float]:
    """The seconds of the clock, as its only number."""
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_elsewhere_than_on_a_terminal_a_line_is_written_every_ten_seconds(clock, capsys):
    """A part that began at 20 % and took 10 seconds to 40 % has 30 seconds left."""
    with Progress(0.2) as bar:
        for seconds, share in ((5, 0.3), (10, 0.4), (19, 0.5), (20, 0.6), (29.9, 0.7)):
            clock[0] = 100.0 + seconds
            bar.show(share, f"step {round(10 * share)}")
        bar.show(1.0, "done")
    printed = capsys.readouterr()
    assert printed.out == "" and printed.err.splitlines() == [
        " 40% 00:10<00:30 step 4",
        " 60% 00:20<00:20 step 6",
        "100% 00:29<00:00 done",
    ]


def test_a_terminal_shows_a_bar(monkeypatch):
    """It begins where the run goes on, and ends its line."""
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    with Progress(0.25) as bar:
        assert " 25%|" in terminal.getvalue()
        bar.show(0.5, "step 7")
        bar.show(0.75, "step 8")
        assert not terminal.getvalue().endswith("\n")
    shown = terminal.getvalue()
    assert " 75%|" in shown.split("\r")[-1] and "step 8" in shown and shown.endswith("\n")


def test_a_part_that_may_take_long_is_said_at_once(clock, capsys):
    with Progress(0.0, at_once=True) as bar:
        bar.show(0.0, "first")
        bar.show(0.5, "second")
    assert capsys.readouterr().err == "  0% 00:00<? first\n"


def test_a_line_beside_the_bar_stands_alone_and_the_clock_goes_on(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    with Progress(0.25) as bar:
        bar.show(0.5, "step 7")
        with bar.aside():
            cleared = terminal.getvalue()
            terminal.write("a line\n")
        assert cleared.endswith("\r") and cleared.split("\r")[-2].strip() == ""
        assert "step 7" in terminal.getvalue().rpartition("a line\n")[2]
        shown = terminal.getvalue()
        bar.show(0.5, "step 7")
        assert len(terminal.getvalue()) > len(shown)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_first_signal_asks_and_the_second_is_as_before(number):
    seen = []
    others = {s: signal.signal(s, lambda s, frame: seen.append(s)) for s in (signal.SIGINT, signal.SIGTERM)}
    try:
        with Interrupt() as interrupt:
            assert not interrupt.asked
            signal.raise_signal(number)
            assert interrupt.asked and seen == []
            signal.raise_signal(number)
            assert seen == [number]
        with Interrupt():
            pass
        for s in others:
            signal.raise_signal(s)
        assert seen == [number, *others]
    finally:
        for s, handler in others.items():
            signal.signal(s, handler)
