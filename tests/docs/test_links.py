"""Links of the pages lead to files that are there, and every page can be reached
from the README.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def linked(page: Path) -> set[Path]:
    """Files that a page links to."""
    text = re.sub(
        r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE
    )
    targets = re.findall(r"\]\((?!https?:|#)([^)#\s]+)", text)
    return {(page.parent / target).resolve() for target in targets}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_linked_files_are_there(page: Path) -> None:
    assert [path for path in linked(page) if not path.exists()] == []


def test_every_page_is_linked_from_the_readme_or_a_page_that_is() -> None:
    reached, new = set(), {ROOT / "README.md"}
    while new:
        reached |= new
        new = {path for page in new for path in linked(page) if path.suffix == ".md"} - reached
    assert set(PAGES) <= reached


@pytest.mark.parametrize("name", ["XOSC_SCHEMA_DIR", "XOSC_CACHE_DIR"])
def test_environment_variables_are_those_of_the_code(name: str) -> None:
    assert f"`{name}`" in (ROOT / "docs" / "settings.md").read_text(encoding="utf-8")
    assert any(
        f'"{name}"' in path.read_text(encoding="utf-8") for path in ROOT.glob("schemas/**/*.py")
    )


def test_messages_of_the_page_on_trouble_are_those_of_the_code() -> None:
    page = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
    rows = [line.split(" | ")[0] for line in page.splitlines() if line.startswith("| `")]
    messages = [message for row in rows for message in re.findall(r"`([^`]+)`", row)]
    folders = ("schemas", "xosc", "xodr", "runner", "generation", "recognition")
    files = (path for folder in folders for path in ROOT.glob(f"{folder}/**/*.py"))
    code = "".join(path.read_text(encoding="utf-8") for path in files)
    assert len(messages) > 10
    assert [
        message for message in messages if message not in code and message.lower() not in code
    ] == []
