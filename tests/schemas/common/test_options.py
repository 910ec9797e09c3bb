"""Options of commands, declared with the settings that they set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
import typer
from typer.testing import CliRunner

from schemas.common.errors import UsageError
from schemas.common.terminal.command_line import App
from schemas.common.terminal.options import PlainValues, option, part, with_settings


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


def _shown(*arguments: str) -> tuple[int, str]:
    """Exit code and output of a command with an option of each type, which prints its values."""
    app = App()

    @app.command()
    def command(
        paths: list[str],
        number: Annotated[float, typer.Option(min=0.5, max=1e6)] = 0.5,
        count: Annotated[int | None, typer.Option(min=1)] = None,
        text: str = "usual",
        word: Literal["skipped", "error"] = "skipped",
        file: Path | None = None,
        folder: Annotated[Path | None, typer.Option(file_okay=False)] = None,
        there: Annotated[Path | None, typer.Option(exists=True)] = None,
        several: list[float] | None = None,
        files: list[Path] | None = None,
    ) -> None:
        given: Any = (paths, number, count, text, word, file, folder, there, several, files)
        print(repr(given))

    result = CliRunner().invoke(app, list(arguments))
    return result.exit_code, result.output


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["a"],
        ["a", "b", "--number", "0.75", "--count", "3", "--text", "", "--word", "error"],
        *(["a", "--number", text] for text in ("1e3", "nan", "inf", " 1", "1_0", "-2", "0.1", "x",
            "")),
        *(["a", "--count", text] for text in ("0", "-1", "1.0", "+1", "9" * 30, "0x2", "x")),
        ["a", "--word", "ERROR"],
        *(["a", option, text] for option in ("--file", "--folder", "--there") for text in (".",
            __file__, "no/such")),
        ["a", "--several", "1", "--several", "2.5"],
        ["a", "--several", "1", "--several", "x"],
        ["a", "--files", ".", "--files", "no/such"],
    ],
    ids=" ".join,
)  # fmt: skip
def test_plain_values_are_those_that_typer_reads(
    arguments: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    ours = _shown(*arguments)
    monkeypatch.setattr(PlainValues, "read", lambda parameters: None)
    assert ours == _shown(*arguments)
