"""Hooks of MkDocs: pages of the repository outside `docs` join the site, and links between all
pages follow them."""

from __future__ import annotations

import os
import re
from pathlib import Path, PurePosixPath
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"

MOVED = {
    "README.md": "index.md",
    "docs/README.md": "documents.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
    "recognition/models/cpu/README.md": "model-card.md",
    "generation/loop/demo/README.md": "demo-recordings.md",
}
"""Path of a page in the repository → its place in the site."""

_CODE_OR_LINK = re.compile(r"^```.*?^```|(?<=\]\()(?![a-z]+:|#)[^)\s]+", re.DOTALL | re.MULTILINE)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Put the moved pages in their places."""
    replaced = files.get_file_from_path("README.md")
    if replaced is not None:
        files.remove(replaced)
    for source, place in MOVED.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        files.append(File.generated(config, place, content=relinked(text, ROOT / source, place)))
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Lead links of the other pages to the moved ones."""
    place = page.file.src_uri
    return markdown if place in MOVED.values() else relinked(markdown, DOCS / place, place)


def relinked(text: str, source: Path, place: str) -> str:
    """Return the text with its relative links as they are seen from its place in the site; code is
    left alone.

    Args:
        text: Markdown of the page.
        source: File of the page in the repository.
        place: Path of the page in the site.
    """

    def replaced(found: re.Match[str]) -> str:
        if found[0].startswith("```"):
            return found[0]
        target, hash_, anchor = found[0].partition("#")
        path = Path(os.path.normpath(source.parent / target))
        inside = path.relative_to(ROOT).as_posix()
        there = MOVED.get(inside) or inside.removeprefix("docs/")
        return os.path.relpath(there, PurePosixPath(place).parent) + hash_ + anchor

    return _CODE_OR_LINK.sub(replaced, text)
