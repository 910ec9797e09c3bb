"""Options of commands, declared with the settings that they set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from schemas.common.errors import UsageError
from schemas.common.terminal.options import option, part, with_settings


@dataclass(frozen=True)
class World:
    step: float = option(0.05, "Time step.", metavar="SECONDS")
    seed: int = option(7, "Seed.")
    folders: tuple[str, ...] = option((), "Folders.", "--folder")


@dataclass(frozen=True)
class Settings:
    world: World = part(World, "step", "folders")
    name: str | None = option(None, "Name.", "--called", parameter="called")
    values: Mapping[str, str] = option({}, "Values.", "--pin")
    table: Path | None = option(None, "Table.")
    quick: bool = option(True, "Quick.", "--quick/--slow")
    inner: int = 3


def called(*arguments: str) -> Settings:
    """The settings that a command line gives."""
    found = []
    app = typer.Typer()

    @app.command()
    @with_settings
    def command(path: str, settings: Settings) -> None:
        found.append(settings)

    result = CliRunner().invoke(app, ["there", *arguments], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return found[0]


def test_without_options_a_command_has_the_settings_by_default() -> None:
    assert called() == Settings()


def test_options_of_fields_and_of_parts_set_them() -> None:
    given = (
        "--step",
        "0.1",
        "--folder",
        "a",
        "--folder",
        "b",
        "--called",
        "x",
        "--pin",
        "A=1",
        "--pin",
        "B=2",
        "--table",
        "t",
        "--slow",
    )
    assert called(*given) == Settings(
        World(0.1, folders=("a", "b")), "x", {"A": "1", "B": "2"}, Path("t"), False
    )


@pytest.mark.parametrize("option", ["--seed", "--inner"])
def test_fields_that_are_not_offered_are_no_options(option: str) -> None:
    with pytest.raises(AssertionError, match="No such option"):
        called(option, "1")


def test_a_value_that_names_no_parameter_is_refused() -> None:
    with pytest.raises(UsageError, match="--pin 'A': NAME=VALUE is expected"):
        called("--pin", "A")
