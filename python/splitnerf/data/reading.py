"""How data are read where they leave it open: what is held out for testing, and what their masks mean."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

EVAL_MODES = ("auto", "all", "fraction", "filename")
MASK_KINDS = ("auto", "object", "ignore")
SEPARATED = "separated"  # the folder of a run that holds masks found for photos without any
SEPARATION = "separation.json"  # its last file


@dataclass(frozen=True)
class Reading:
    """How to read a data set.

    Attributes:
        eval_mode: What the test split is. "auto": what the data say, else as "fraction"; "all": all views, and the
            train split too; "fraction": every 8th view; "filename": the views with `test` or `eval` in their path, the
            others have `train` in it.
        mask_kind: What mask files mean whose layout leaves it open. "object": white is the object; "ignore": black is
            to be ignored; "auto": what the masks look like.
        separated: The folder in which training wrote masks of photos that have none; or None.
        max_memory: GB that all photos may take in memory, more are read from a file; 0: half of what is available.
    """

    eval_mode: str = "auto"
    mask_kind: str = "auto"
    separated: Path | None = None
    max_memory: float = field(default=0.0, compare=False)  # it changes no value


def is_separated(folder: Path) -> bool:
    """Whether a folder holds all masks that were found for photos without any."""
    return (folder / SEPARATION).is_file()
