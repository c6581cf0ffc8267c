"""How Sphinx makes the site from these pages, the docstrings and the commands' help (``make docs``; decision 0010)."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS), str(DOCS.parent)]  # the checkout's own packages, whatever is installed

import site_parts  # noqa: E402

from haptics.version import __version__  # noqa: E402

project = "wearable-haptics"
author = "The wearable-haptics authors"
copyright = author
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.apidoc", "sphinx.ext.intersphinx"]
root_doc = "index"
exclude_patterns = ["_build", "reference/api/*/modules.rst"]
html_theme = "furo"
html_title = f"wearable-haptics {release}"

# Pages are Markdown that reads as well on a code host as here: links to files and to headings, no directives.
myst_heading_anchors = 4
myst_links_external_new_tab = True
# A fence in a language of our own; a bare name that two modules define.
suppress_warnings = ["config.cache", "misc.highlighting_failure", "ref.python"]

# The reference is made of docstrings; commands document themselves by their help.
apidoc_modules = [
    {
        "path": str(DOCS.parent / room),
        "destination": f"reference/api/{room}",
        "exclude_patterns": [
            str(DOCS.parent / room / part) for part in ("cli/**", "**/data/**", "**/firmware/**", "commands.py", "*/command.py")
        ],
        "max_depth": 2,
        "separate_modules": True,
        "include_private": False,
    }
    for room in site_parts.ROOMS
]
apidoc_automodule_options = {"members", "show-inheritance"}
autodoc_default_options = {
    "members": True,
    "show-inheritance": True,
    "ignore-module-all": True,
}  # a name where it is defined, once
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autodoc_mock_imports = ["torch", "anny", "rerun", "pypardiso", "cvxopt"]  # the site builds without what is large or not free
os.environ.setdefault("MPLBACKEND", "Agg")  # and without a display

# Names of other projects link to their documentation only where somebody asks for it: a build needs no network.
_ELSEWHERE = {
    "python": "https://docs.python.org/3",
    "numpy": "https://numpy.org/doc/stable",
    "scipy": "https://docs.scipy.org/doc/scipy",
    "h5py": "https://docs.h5py.org/en/stable",
}
intersphinx_mapping = {name: (url, None) for name, url in _ELSEWHERE.items()} if os.environ.get("HAPTICS_DOCS_ONLINE") else {}
linkcheck_anchors = False  # internal anchors are checked by every build
linkcheck_timeout = 20


def setup(app: Any) -> None:
    """Hook what ``site_parts`` makes into the build.

    :param app: Sphinx.
    """
    app.connect("builder-inited", site_parts.write_made_pages)
    app.connect("source-read", site_parts.contents)
    app.connect("autodoc-process-docstring", site_parts.fields_apart)
