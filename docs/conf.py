"""How the documentation is built: ``python -m sphinx -W -b html docs build/docs``, without network."""

import os
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE / "extensions")]

# Pictures need no window, also those of processes that draw the gallery.
os.environ["MPLBACKEND"] = "Agg"

import sfetcas  # noqa: E402

project = "sfetcas"
author = "the authors of sfetcas"
copyright = "the authors of sfetcas"
version = release = sfetcas.__version__
html_title = f"sfetcas {release}"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "numpydoc",
    "plots",
    "formulas",
    "reference",
    "gallery",
]
exclude_patterns = ["extensions", "**/generated"]
nitpicky = True
# Names keep the quotes that they have.
smartquotes = False
# Names of other libraries have no page here, and what validates keys is part of their types.
nitpick_ignore_regex = [
    ("py:.*", r"(casadi|collections|concurrent|multiprocessing|numpy|pydantic)\b.*"),
    ("py:.*", r"sfetcas\.description\.records\.(_\w+|T)|lambda"),
]

myst_enable_extensions = ["attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"
# Each object in the table of contents of each page would take most of the time of a build.
toc_object_entries = False

html_theme = "furo"
html_math_renderer = "svg"
html_show_sphinx = False
html_copy_source = False
html_theme_options = {"navigation_with_keys": True}

plot_formats = [("png", 110)]
plot_html_show_formats = False
plot_html_show_source_link = False
plot_rcparams = {"figure.dpi": 110}
plot_working_directory = str(HERE.parent)
