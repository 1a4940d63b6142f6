"""Configuration of the documentation site: `python -m sphinx -W docs build/docs`.

The build runs the notebooks and shows their outputs. `-D nb_execution_mode=off` leaves the outputs out."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import docstrings
import generated_pages

import esail_jax

project = "esail_jax"
author = "The esail_jax developers"
release = esail_jax.__version__
extensions = ["mathml", "myst_nb", "sphinx.ext.autodoc", "sphinx_copybutton", "sphinx_design"]
exclude_patterns = ["Thumbs.db", ".DS_Store", "generated/downloads"]

html_theme = "furo"
html_title = f"esail_jax {release}"
html_show_sourcelink = False
html_show_copyright = False
html_static_path = ["static"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"  # `mathml.py`: formulas without a network

myst_enable_extensions = ["attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
# Outputs of notebooks are kept, and used again until the code of a notebook or of the package changes.
nb_execution_mode = "cache"
nb_execution_cache_path = str(generated_pages.kept_outputs())
nb_execution_timeout = 600  # seconds for a cell, on a busy machine
nb_execution_in_temp = True  # notebooks write their files into a temporary folder
nb_execution_raise_on_error = True
suppress_warnings = ["myst.header"]  # some included READMEs have headings that skip a level

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True


def setup(app):
    generated_pages.write()
    app.connect("autodoc-process-docstring", docstrings.to_rst)
