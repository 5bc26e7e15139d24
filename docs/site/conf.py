"""Sphinx's settings for docs/*.md, which stay readable without it: sphinx-build -c docs/site docs OUT (docs/site/build.sh)."""

import os
import pathlib
import re
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parent))

import public_api  # noqa: E402

SOURCE = pathlib.Path(__file__).resolve().parents[2]

project = "lapservo"
copyright = "the lapservo authors, BSD-3-Clause"  # noqa: A001, Sphinx's name for it
version = release = re.search(r"project\(lapservo VERSION ([0-9.]+)", (SOURCE / "CMakeLists.txt").read_text())[1]
extensions = ["myst_parser", "breathe"]
myst_enable_extensions = ["deflist"]
myst_heading_anchors = 3
exclude_patterns = ["site"]
smartquotes = False  # makes another sign of the two dashes of an option
highlight_language = "text"

breathe_projects = {"lapservo": os.environ["LAPSERVO_DOXYGEN_XML"]}
breathe_default_project = "lapservo"
breathe_default_members = ("members",)
cpp_index_common_prefix = ["lapservo::"]

html_theme = "furo"
html_title = "lapservo"
html_static_path = ["static"]
html_css_files = ["lapservo.css"]
html_copy_source = False
html_show_sphinx = False
html_last_updated_fmt = None
linkcheck_timeout = 20


def point_to_pages(_app, _page, text):
    """Folders of examples are one page here."""
    text[0] = re.sub(r"\]\(\.\./examples/[a-z_]+\)", "](examples.md)", text[0])


def list_headers(_app, page, text):
    if page == "cpp":
        text[0] = re.sub(r"<!--.*?-->", lambda _: public_api.page(SOURCE, os.environ["LAPSERVO_DOXYGEN_XML"]), text[0], flags=re.DOTALL)


def setup(app):
    app.connect("source-read", point_to_pages)
    app.connect("source-read", list_headers)
