"""The self-contained HTML report of a run."""

from splitnerf_tools.report.html import write_report

__all__ = ["write_report"]
