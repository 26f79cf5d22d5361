"""Sphinx's configuration: `make docs` builds this folder into build/docs/html."""

from __future__ import annotations

import os
import sys
from pathlib import Path

os.environ["NUMBA_DISABLE_JIT"] = "1"  # docstrings need nothing compiled

import qpsafe

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))  # the extensions below are scripts of this folder

project, author, copyright = "qpsafe", "The qpsafe developers", "the qpsafe developers, Apache-2.0"
version = release = qpsafe.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    "site_pages.setup",
]
exclude_patterns = ["data", "img", "site_pages"]

# Markdown as GitHub shows it: its anchors, its fences.
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 4

# Docstrings: Google style; names in backticks are links where they name something (site_pages/markup.py).
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
napoleon_use_ivar = True
napoleon_attr_annotations = False
napoleon_use_rtype = False
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 90
nitpicky = True
nitpick_ignore_regex = [("py:(?!obj).*", ".*")]  # types in signatures: whatever NumPy and others call theirs

html_theme = "furo"
html_title = f"qpsafe {release}"
html_extra_path = ["../build/recordings"] if (HERE.parent / "build" / "recordings").exists() else []
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_theme_options = {"navigation_with_keys": True}
html_show_sourcelink = False
pygments_style, pygments_dark_style = "friendly", "github-dark"
copybutton_exclude = ".linenos, .gp, .go"
