"""Configuration of the documentation site: `python -m sphinx -W docs build/docs`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import docstrings
import generated_pages

import esail_jax

project = "esail_jax"
author = "The esail_jax developers"
release = esail_jax.__version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx_copybutton", "sphinx_design"]
exclude_patterns = ["Thumbs.db", ".DS_Store"]

html_theme = "furo"
html_title = f"esail_jax {release}"
html_show_sourcelink = False
html_show_copyright = False
html_static_path = ["static"]
html_css_files = ["site.css"]
html_js_files = ["pictures.js"]

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
# Notebooks are run by `tests/interface/test_notebooks.py`. The site runs them, and shows what they print
# and draw, only if it is asked to: `-D nb_execution_mode=cache`, five minutes the first time. The published
# site does so.
nb_execution_mode = "off"
nb_execution_timeout = 600  # seconds per cell; one of a gradient compiles for a minute
nb_execution_raise_on_error = True
suppress_warnings = ["myst.header"]  # some included READMEs have headings that skip a level

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True


def setup(app):
    generated_pages.write()
    app.connect("autodoc-process-docstring", docstrings.to_rst)
