"""The examples in docstrings of the public interface run as they are printed,
and every public name has one.
"""

from __future__ import annotations

import doctest
import inspect
from pathlib import Path
from typing import Any

import pytest

import xosc_toolchain
from runner.recording import Recording
from xodr.builders import straight_highway
from xosc import sample

ROOT = Path(__file__).parents[2]
PUBLIC = {name: getattr(xosc_toolchain, name) for name in xosc_toolchain.__all__}
EXAMPLES = {name: value for name, value in PUBLIC.items() if not inspect.ismodule(value)}
EXAMPLES |= {"Recording": Recording, "sample": sample, "straight_highway": straight_highway}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A working folder in which the libraries are, as in the repository, and
    that examples write into.
    """
    for name in ("xosc", "xodr"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)


def example_of(value: Any) -> doctest.DocTest:
    """The example in the docstring of a class or function."""
    return doctest.DocTestParser().get_doctest(
        inspect.getdoc(value) or "", {}, value.__qualname__, None, None
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_the_example_gives_what_it_prints(name: str) -> None:
    example = example_of(inspect.unwrap(EXAMPLES[name]))
    assert "Example:" in (inspect.getdoc(EXAMPLES[name]) or "")
    assert any(each.want for each in example.examples)
    said: list[str] = []
    failed = (
        doctest.DocTestRunner(optionflags=doctest.REPORT_ONLY_FIRST_FAILURE)
        .run(example, out=said.append)
        .failed
    )
    assert not failed, "".join(said)


def test_the_most_used_names_have_examples() -> None:
    assert len(EXAMPLES) >= 30
