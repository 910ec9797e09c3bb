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

from tests.runner.chromium import Browser

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


_SEARCH = """new Promise((resolve) => {
  const found = () => [...document.querySelectorAll(".md-search-result__link")].map((a) => a.href);
  const field = document.querySelector(".md-search__input");
  document.querySelector("#__search").click();
  field.focus();
  const ask = setInterval(() => {
    field.value = "bisection";
    field.dispatchEvent(new Event("input", { bubbles: true }));
    field.dispatchEvent(new Event("keyup", { bubbles: true }));
    if (found().length) { clearInterval(ask); resolve(found()); }
  }, 200);
  setTimeout(() => { clearInterval(ask); resolve([]); }, 20000);
})"""
_CUT = """[...document.querySelectorAll(".md-content pre code")]
  .filter((code) => code.scrollWidth > code.clientWidth + 1).map((code) => code.textContent)"""


@pytest.mark.slow
def test_pages_opened_from_a_folder_are_searched_and_cut_off_no_code(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    built(tmp_path / "site", caplog)
    with Browser(tmp_path / "profile") as browser:
        for page in ("index.html", "generation.html", "tutorials/first-run.html"):
            browser.open(tmp_path / "site" / page, width=1400)
            assert browser.run(_CUT) == []
        found = browser.run(_SEARCH)
        assert found and all(link.startswith("file://") for link in found)
        assert browser.errors == []


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
