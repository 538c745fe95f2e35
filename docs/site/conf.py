"""The site: `make docs` writes build/site. Nothing of it is loaded from a network."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1])]

from studies.threads import one_thread  # noqa: E402

one_thread()  # before NumPy is imported

import symheli  # noqa: E402

project = "symheli"
author = "The symheli developers"
project_copyright = author
version = release = symheli.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "executed",
    "mathml",
    "reference",
]
exclude_patterns = ["site"]
myst_enable_extensions = ["amsmath", "dollarmath"]
myst_heading_anchors = 3
default_role = "code"
nitpicky = False

autodoc_default_options = {"members": True}
autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_class_signature = "mixed"
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_param = False  # shapes are no links
napoleon_use_rtype = False

html_theme = "furo"
html_title = f"symheli {release}"
html_math_renderer = "mathml"
html_copy_source = False
html_show_search_summary = False  # fetches pages, which a browser refuses to one from disk
html_show_sphinx = False
html_static_path = ["static"]
html_css_files = ["site.css"]
html_theme_options = {"navigation_with_keys": True}
pygments_style = "friendly"
