"""Programs of users are typed: the README's own one is accepted by a strict
checker, an unknown setting is not.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from runner.judging.settings import RunSettings, SettingChanges

ROOT = Path(__file__).parents[2]
WRONG = (
    'import xosc_toolchain as xt\n\nxt.run("simple_cut_in", '
    'sutt="adas")\nxt.run("simple_cut_in", seed="1")\n'
)


def test_settings_by_name_are_those_of_the_class() -> None:
    changes = SettingChanges.__annotations__
    own = RunSettings.__annotations__
    assert {name: each.__forward_arg__ for name, each in changes.items()} == own


@pytest.mark.slow
def test_a_strict_checker_accepts_the_readme_and_no_unknown_setting(tmp_path: Path) -> None:
    names = list[str]()
    for page in ("README.md", "docs/tutorials/from-python.md"):
        text = (ROOT / page).read_text(encoding="utf-8")
        fences = [part.split("```", 1)[0] for part in text.split("```python\n")[1:]]
        assert fences
        for fence in fences:
            names.append(f"fence{len(names)}.py")
            (tmp_path / names[-1]).write_text(fence)
    text = (ROOT / "docs/tutorials/your-own-system.md").read_text(encoding="utf-8")
    own, compared = [part.split("```", 1)[0] for part in text.split("```python\n")[1:]]
    for name, fence in {"my_driver.py": own, "compared.py": compared}.items():
        names.append(name)
        (tmp_path / name).write_text(fence)
    (tmp_path / "wrong.py").write_text(WRONG)
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", *names, "wrong.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    lines = [line for line in checked.stdout.splitlines() if ": error" in line]
    assert [line.partition(": error")[0] for line in lines] == ["wrong.py:3", "wrong.py:4"]
    assert 'Unexpected keyword argument "sutt" for "run"' in lines[0]
