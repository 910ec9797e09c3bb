"""Bars of finished items on terminals, those of many items a second with their rate; lines in logs."""

import io
import re
import sys
import time

import pytest

from schemas.common.terminal import command_line
from schemas.common.terminal.command_line import progress_bar


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def _shown(monkeypatch: pytest.MonkeyPatch, stream: io.StringIO) -> str:
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "160")
    with progress_bar("runs", 4, quiet=False) as progress:
        progress(2)
        draws = progress.below("draws", 3000)
        draws(1000)
        draws(2000)
    return stream.getvalue()


def test_a_bar_below_shows_its_items_and_their_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = _shown(monkeypatch, Terminal())
    assert "2/4" in shown and "3000/3000" in shown and "a second" in shown
    runs = [line for line in shown.splitlines() if "runs" in line]
    assert runs and not any("a second" in line for line in runs)


def test_a_short_work_has_no_line_in_a_file(monkeypatch: pytest.MonkeyPatch) -> None:
    assert _shown(monkeypatch, io.StringIO()) == ""


def test_a_log_has_a_line_now_and_then(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without an item, too: the first one may take minutes."""
    monkeypatch.setattr(command_line, "_PATIENCE", 0.01)

    def line() -> str:
        while not (told := capsys.readouterr().err.splitlines()):
            time.sleep(0.01)
        return re.sub(r"after [\d,]+ s", "after … s", told[-1])

    with command_line.progress_bar("searching", 1500, quiet=False) as advance:
        assert line() == "searching: 0 of 1,500 after … s"
        advance(140)
        advance.phase("estimate")
        line()
        assert line() == "searching: 140 of 1,500 after … s, estimate"
        draws = advance.below("draws", 4000)
        draws(1000)
        line()
        assert line() == "draws: 1,000 of 4,000 after … s"
        advance.phase("report")
        line()
        assert line() == "searching: 140 of 1,500 after … s, report"
    time.sleep(0.05)
    capsys.readouterr()
    time.sleep(0.05)
    assert not capsys.readouterr().err, "it ends with the work"
