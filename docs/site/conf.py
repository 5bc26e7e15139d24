"""Sphinx's settings for docs/*.md, which stay readable without it (docs/site/build.sh)."""

import os
import pathlib
import re
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parent))

import public_api  # noqa: E402
import python_api  # noqa: E402

SOURCE = pathlib.Path(__file__).resolve().parents[2]

project = "lapservo"
copyright = "the lapservo authors, BSD-3-Clause"  # noqa: A001, Sphinx's name for it
version = release = re.search(r"project\(lapservo VERSION ([0-9.]+)", (SOURCE / "CMakeLists.txt").read_text())[1]
extensions = ["myst_parser", "breathe", "sphinx_copybutton"]
myst_enable_extensions = ["deflist"]
myst_heading_anchors = 3
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
html_favicon = "static/icon.svg"
html_copy_source = False
html_show_sphinx = False
html_last_updated_fmt = None
linkcheck_timeout = 20


def menu(index):
    """The menu of the site: sections and links of the first page."""
    sections = re.findall(r"^## (.*)\n((?:.*\n)*?)(?=^## |\Z)", index, re.MULTILINE)
    for title, text in sections:
        pages = "\n".join(re.findall(r"\]\(([a-z_-]+)\.md\)", text))
        yield f"```{{toctree}}\n:hidden:\n:caption: {title}\n\n{pages}\n```\n"


def add_generated(_app, page, text):
    """Pages are plain Markdown; here they get the menu, the commands, Python's names and the files that they link to."""
    if page == "index":
        text[0] += "\n" + "\n".join(menu(text[0]))
    if page == "cli":
        commands = (SOURCE / "build" / "reference" / "cli.md").read_text()
        text[0] = re.sub(r"<!--.*?-->", lambda _: re.sub(r"^(#.*)", r"#\1", commands, flags=re.MULTILINE), text[0], flags=re.DOTALL)
    if page == "python_api":
        text[0] = re.sub(r"<!--.*?-->", lambda _: python_api.page(), text[0], flags=re.DOTALL)
    text[0] = re.sub(r"^\[.*\]\(\.\./((?:examples|transports)/.*\.([a-z]+))\)$", show_file, text[0], flags=re.MULTILINE)


def show_file(link):
    language = {"py": "python", "txt": "cmake", "cpp": "cpp"}.get(link[2], "text")
    return f"```{{literalinclude}} ../{link[1]}\n:language: {language}\n```"


def leave_out_links(_app, page, text):
    """Links to what is not part of the site: folders of examples are one page here, of others the name stays."""
    outside = "../" * (page.count("/") + 1)
    text[0] = re.sub(r"\]\(\.\./examples/[a-z_/.]+\)", "](examples.md)", text[0])
    text[0] = re.sub(rf"\[([^\]]*)\]\({re.escape(outside)}[^)]*\)", r"\1", text[0])
    if page.startswith("notes/"):  # not in the menu
        text[0] = "---\norphan: true\n---\n\n" + text[0]


def add_headers(app):
    """The pages of the C++ headers, and their menu on the page cpp."""
    folder = pathlib.Path(app.srcdir)
    names = public_api.write_pages(SOURCE, os.environ["LAPSERVO_DOXYGEN_XML"], folder)
    cpp = folder / "cpp.md"
    menu_of_headers = "```{toctree}\n:maxdepth: 2\n\n" + "\n".join(names) + "\n```"
    cpp.write_text(re.sub(r"<!--.*?-->", menu_of_headers, cpp.read_text(), flags=re.DOTALL))


def setup(app):
    app.connect("builder-inited", add_headers)
    app.connect("source-read", add_generated)
    app.connect("source-read", leave_out_links)
