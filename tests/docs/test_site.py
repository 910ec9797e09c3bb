"""The site builds without a network, links to pages and anchors that are there,
and loads nothing from elsewhere.
"""

from __future__ import annotations

import logging
import re
from pathlib import Path

import pytest

pytest.importorskip("material")
from mkdocs.commands.build import build
from mkdocs.config import load_config
from mkdocs.exceptions import Abort

ROOT = Path(__file__).parents[2]
_LOADED = re.compile(
    r"<(?:script|link|img|iframe|source)\b[^>]*?\b(?:src|href)=[\"']?((?:https?:)?//[^\s\"'>]+)"
)


def built(folder: Path, caplog: pytest.LogCaptureFixture, **settings: object) -> list[str]:
    """Build the site into a folder and return the warnings, each of which ends a
    build that is strict.
    """
    with caplog.at_level(logging.WARNING, "mkdocs"):
        try:
            build(load_config(str(ROOT / "mkdocs.yml"), site_dir=str(folder), **settings))
        except Abort:
            assert caplog.messages
    return caplog.messages


@pytest.mark.slow
def test_site_builds_strictly_and_loads_nothing_from_elsewhere(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    assert built(tmp_path, caplog) == []
    pages = list(tmp_path.rglob("*.html"))
    assert {"index.html", "recognition-results.html", "model-card.html"} <= {
        page.name for page in pages
    }
    foreign = {
        found for page in pages for found in _LOADED.findall(page.read_text(encoding="utf-8"))
    }
    assert foreign == set()
    assert (tmp_path / "search" / "search_index.json").stat().st_size > 100_000


def test_broken_link_and_anchor_are_found(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    docs = tmp_path / "docs"
    docs.mkdir()
    (docs / "index.md").write_text(
        "# Page\n\n[lost](nowhere.md) and [gone](#nowhere)\n", encoding="utf-8"
    )
    warnings = built(
        tmp_path / "site",
        caplog,
        docs_dir=str(docs),
        hooks=[],
        nav=[{"Page": "index.md"}],
        extra_css=[],
    )
    assert sum("nowhere" in warning for warning in warnings) == 2
