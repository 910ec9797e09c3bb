"""Documents are short enough to be read: a limit for all pages written by hand,
and one for each page of results.

    python tests/docs/test_size.py

prints the words of each page. A word is what stands between blanks and has a letter or a digit, in
tables and code too; the rules of tables are none. Tables that are generated into a page do not
count.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GENERATED = {
    ROOT / "docs" / "coverage.md",
    ROOT / "docs" / "publication.md",
    *(ROOT / "docs" / "reference").glob("*.md"),
}
WRITTEN = ("README.md", "docs/**/*.md", "recognition/models/*/README.md", "generation/**/*.md")
PAGES = sorted({page for pattern in WRITTEN for page in ROOT.glob(pattern)} - GENERATED)
RESULTS = ("performance.md", "recognition-results.md", "generation-results.md", "parity.md")
ALL_PAGES, A_RESULT = 30_000, 1_500


def words(page: Path) -> int:
    text = page.read_text(encoding="utf-8")
    text = re.sub(r"<!-- (matrix of [^>]*) -->.*<!-- end of \1 -->", "", text, flags=re.DOTALL)
    text = re.sub(r"(?<=[(\[{])\s+", "", text)  # where code is broken is no matter
    return len(re.findall(r"\S*\w\S*", text))


def test_all_pages_together() -> None:
    assert sum(map(words, PAGES)) <= ALL_PAGES


@pytest.mark.parametrize("name", RESULTS)
def test_page_of_results(name: str) -> None:
    assert words(ROOT / "docs" / name) <= A_RESULT


if __name__ == "__main__":
    for page in PAGES:
        print(f"{words(page):6}  {page.relative_to(ROOT).as_posix()}")
    print(f"{sum(map(words, PAGES)):6}  all")
