"""The self-contained HTML report of a run."""

from splitnerf.report.html import write_report

__all__ = ["write_report"]
