"""Pages of one file, from templates."""

from __future__ import annotations

import os

import jinja2

from splitnerf.files import atomic_path


def write_html(path: str | os.PathLike, package: str, template: str, **values: object) -> None:
    """Fills a template and writes the page, atomically.

    Args:
        path: The file to write.
        package: The package that holds the template; it may include those of :mod:`splitnerf_tools.report`.
        template: The template's file.
        values: What the template names.

    Raises:
        OSError: The page cannot be written.
    """
    loader = jinja2.ChoiceLoader([jinja2.PackageLoader(name, ".") for name in (package, "splitnerf_tools.report")])
    environment = jinja2.Environment(
        loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    page = environment.get_template(template).render(**values)
    with atomic_path(path) as temporary:
        temporary.write_text(page, encoding="utf-8", errors="backslashreplace")
