"""Settings of the documentation: `make docs` builds HTML into build/docs."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import splitnerf

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "reference"))  # where parsers.py is

project = "SplitNeRF"
version = release = splitnerf.__version__
html_title = "SplitNeRF"
html_theme = "furo"
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.mathjax",
    "sphinx_copybutton",
    "sphinxarg.ext",
]
nitpicky = True  # a name that leads nowhere is a warning; these belong to other programs
nitpick_ignore_regex = [("py:.*", r"(torch|numpy|np|Tensor|collections)\b.*"), ("py:class", r".*\.TableCopy")]

# Markdown: $...$ are equations, each heading has the anchor that it has on GitHub.
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 4

# MathJax is one file of a package: pages need no network.
MATHJAX = Path(importlib.util.find_spec("sphinx-mathjax-offline").origin).parent / "static" / "mathjax" / "tex-svg.js"
html_static_path = ["static", str(MATHJAX)]
html_css_files = ["tables.css"]
mathjax_path = MATHJAX.name
mathjax3_config = {"options": {"enableMenu": False}}

# The operators' docstrings.
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
napoleon_numpy_docstring = False
napoleon_use_rtype = False
python_use_unqualified_type_names = True

copybutton_prompt_text = "$ "  # is not copied
