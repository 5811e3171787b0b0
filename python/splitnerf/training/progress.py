"""What a long run shows and hears: its progress bar, and Ctrl-C."""

from __future__ import annotations

import signal
import sys

from tqdm import tqdm


class Interrupt:
    """Turns the first Ctrl-C (or SIGTERM) into a request; a second one ends the program at once."""

    def __enter__(self) -> Interrupt:
        self.asked = False
        self._previous = {s: signal.signal(s, self._ask) for s in (signal.SIGINT, signal.SIGTERM)}
        return self

    def _ask(self, number, frame) -> None:
        self.asked = True
        signal.signal(number, self._previous[number])

    def __exit__(self, *exception) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)


class Progress:
    """The progress bar: share done, time left, PSNR of the batch and samples a ray."""

    def __init__(self, start: float):
        self._bar = tqdm(
            total=100.0, initial=100.0 * start, file=sys.stderr,
            bar_format="{percentage:3.0f}%|{bar:30}| {elapsed}<{remaining} {postfix}",
        )  # fmt: skip

    def __enter__(self) -> Progress:
        return self

    def show(self, progress: float, step: int, psnr: float, samples_per_ray: float) -> None:
        self._bar.set_postfix_str(f"step {step} PSNR {psnr:.2f} dB, {samples_per_ray:.1f} samples/ray", refresh=False)
        self._bar.update(100.0 * progress - self._bar.n)

    def __exit__(self, *exception) -> None:
        self._bar.close()
