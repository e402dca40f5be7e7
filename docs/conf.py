"""Settings of the documentation site: `make docs` builds it into build/site, with warnings as errors."""

import sys
from importlib.metadata import version as version_of
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

project = "Falsework"
author = "The Falsework authors"
project_copyright = "The Falsework authors, Apache-2.0"
version = release = version_of("falsework")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton"]
source_suffix = {".md": "markdown"}
root_doc = "index"
exclude_patterns = ["proof.json", "images", "benchmarks/recon", "notebooks/*.ipynb"]
templates_path: list[str] = []
nitpicky = False
# What docstrings put between single backticks is code.
default_role = "code"

# The pages are read on a code host, too: links and anchors are those of plain Markdown there.
myst_heading_anchors = 4
myst_enable_extensions = ["attrs_inline", "attrs_block"]
suppress_warnings = ["myst.strikethrough"]
# Blocks that show a shell session or a drawing are text, whatever they begin with.
highlight_language = "none"
pygments_style = "friendly"
pygments_dark_style = "monokai"
copybutton_prompt_text = "$ "

autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_preserve_defaults = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_custom_sections = ["Source"]

html_theme = "furo"
html_title = "Falsework"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "sidebar_hide_name": False,
    "navigation_with_keys": True,
    "light_css_variables": {"color-brand-primary": "#9a4a12", "color-brand-content": "#9a4a12"},
    "dark_css_variables": {"color-brand-primary": "#f0a868", "color-brand-content": "#f0a868"},
}
