"""Bars of finished items: on terminals only, and those of many items a second with their rate."""

import io
import sys

import pytest

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
    assert "2/4" in shown and "3000/3000" in shown and shown.count("a second") == 1


def test_nothing_is_shown_to_a_file(monkeypatch: pytest.MonkeyPatch) -> None:
    assert _shown(monkeypatch, io.StringIO()) == ""
