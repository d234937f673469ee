"""The site of closedrooms: ``make docs`` builds it from these pages, the docstrings and ``results/*.csv``."""

import sys
import tomllib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from notebook_page import NOTEBOOK, execute, write_page

project = "closedrooms"
author = "The closedrooms authors"
copyright = author  # noqa: A001
pyproject = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())
release = version = pyproject["project"]["version"]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build"]
# Two hyphens stay two: options stand in tables and notes.
smartquotes = False
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3

autodoc_member_order = "groupwise"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_default_options = {"members": True}
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
python_use_unqualified_type_names = True
add_module_names = False

html_theme = "furo"
html_title = f"closedrooms {release}"
html_static_path = ["static"]
html_css_files = ["tables.css"]
html_show_sphinx = False

write_page(execute(NOTEBOOK), NOTEBOOK.parent)
