"""Sphinx configuration. Build: ``sphinx-build -W --keep-going -b html docs docs/_build/html``."""

import sys
from importlib import metadata
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "colift"
author = "The colift authors"
copyright = author  # noqa: A001 - Sphinx wants this name
release = metadata.version("colift")
version = release

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx-mathjax-offline",
    "sphinx.ext.napoleon",
    "colift_tables",
    "colift_try",
]
exclude_patterns = ["_build"]
source_suffix = {".md": "markdown"}

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
myst_dmath_double_inline = True

autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_use_ivar = True

html_theme = "furo"
html_title = "colift"
html_static_path = ["_static"]
html_css_files = ["colift.css"]
html_show_sphinx = False
pygments_style = "friendly"
pygments_dark_style = "native"
