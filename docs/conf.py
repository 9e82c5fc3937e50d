"""Sphinx settings. What can be made from the code is made here, before Sphinx reads the pages."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import generated  # noqa: E402

import fogpipe  # noqa: E402

project = "fogpipe"
author = "the fogpipe developers"
copyright = author
version = release = fogpipe.__version__

extensions = ["myst_parser", "numpydoc", "sphinx.ext.autodoc", "sphinx.ext.mathjax"]
myst_enable_extensions = ["deflist", "dollarmath", "substitution"]
myst_heading_anchors = 3
myst_substitutions = generated.tables()
numpydoc_show_class_members = False
autodoc_typehints = "none"
exclude_patterns = ["_build"]

html_theme = "pydata_sphinx_theme"
html_title = f"fogpipe {release}"
html_show_sourcelink = False

generated.write_stage_pages(HERE / "reference" / "stages")
