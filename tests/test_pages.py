"""Scripts and styles of all pages are lines that can be read, parse, and define
nothing that nobody uses.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path

import pytest

from generation.loop import page as loop_page
from generation.report import report as report_module
from recognition.catalogue.writing import page as catalogue_page
from runner.view import page as replay_page
from tests.runner.chromium import Browser

ROOT = Path(__file__).parents[1]
FOLDERS = [Path(str(each.__file__)).parent for each in (replay_page, loop_page, catalogue_page)] + [
    Path(str(report_module.__file__)).parent / "page"
]
SOURCES = sorted(
    path for folder in FOLDERS for path in folder.rglob("*.*") if path.suffix in (".js", ".css")
)
SCRIPTS = [path for path in SOURCES if path.suffix == ".js"]
_LONGEST = 130
_AVOIDED = {
    r"\bvar\s+\w": "const or let",
    r"[^=!]==[^=]|!=[^=]": "=== and !==",
    r"\binnerHTML\b|\bdocument\.write\b|\beval\b|\bnew Function\b": (
        "text nodes: text from files must never become code"
    ),
    r"\bconsole\.|\bdebugger\b|\balert\(": "nothing that is left from debugging",
}


def named(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def code(path: Path) -> str:
    """A script without comments."""
    return re.sub(
        r"^\s*//.*$|/\*[\s\S]*?\*/", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE
    )


@pytest.mark.parametrize("path", SOURCES, ids=named)
def test_lines_can_be_read(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert text.endswith("\n") and not text.endswith("\n\n")
    wrong = [
        number
        for number, line in enumerate(text.splitlines(), 1)
        if len(line) > _LONGEST or line != line.rstrip() or "\t" in line
    ]
    assert wrong == [], "longer than 130 characters, with tabs, or blanks at the end"


@pytest.mark.parametrize("path", SCRIPTS, ids=named)
def test_scripts_avoid_what_is_easily_wrong(path: Path) -> None:
    text = code(path)
    assert [instead for pattern, instead in _AVOIDED.items() if re.search(pattern, text)] == []


def test_scripts_define_nothing_that_nobody_uses() -> None:
    text = "".join(map(code, SCRIPTS))
    defined = re.findall(r"^(?:const|let|function|class) (\w+)", text, flags=re.MULTILINE)
    assert len(defined) > 50
    used = Counter(re.findall(r"\w+", text))
    assert [name for name in defined if used[name] < 2] == []


@pytest.mark.slow
def test_scripts_parse(tmp_path: Path) -> None:
    """By node where it is installed, else by Chromium; the tests of the pages run them."""
    node = shutil.which("node")
    if node is not None:
        for path in SCRIPTS:
            done = subprocess.run(
                [node, "--check", str(path)], capture_output=True, text=True, check=False
            )
            assert done.returncode == 0, done.stderr
        return
    with Browser(tmp_path) as browser:
        for path in SCRIPTS:
            source = path.read_text(encoding="utf-8")
            answer = browser.call(
                "Runtime.compileScript",
                expression=source,
                sourceURL=path.as_uri(),
                persistScript=False,
            )
            assert "exceptionDetails" not in answer, (path, answer)
