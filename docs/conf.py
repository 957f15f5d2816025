"""How Sphinx builds the documentation; `sh docs/build.sh` does it in an environment of its own."""

import sys
from pathlib import Path

import oatkit

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "oatkit"
author = "The oatkit developers"
project_copyright = "The oatkit developers"
version = release = oatkit.__version__

extensions = ["myst_parser", "sphinx_gallery.gen_gallery", "sphinx.ext.autodoc", "oatkit_docs"]
exclude_patterns = ["_build", "_ext", "gallery"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
default_role = "py:obj"
highlight_language = "none"
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
python_maximum_signature_line_length = 90
oatkit_repository = ""  # the address below which files of the repository lie, once there is one

sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "auto_gallery",
    "filename_pattern": r"\.py$",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "write_computation_times": False,
    "download_all_examples": False,
}

html_theme = "pydata_sphinx_theme"
html_title = "oatkit"
html_math_renderer = "mathml"
html_static_path = ["_static"]
html_css_files = ["custom.css"]
html_show_sourcelink = False
html_theme_options = {"navbar_align": "left", "header_links_before_dropdown": 7, "show_toc_level": 2}
