"""`python -m studies.recognition`: its commands, their output and their refusals."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from schemas.common.packages import version
from studies.recognition.__main__ import NAME, main
from tests.commands import Answer
from tests.recognition.traffic import Car, write_highd

Study = Callable[..., Answer]


@pytest.fixture
def study(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Study:
    """The command in this process."""

    def call(*arguments: object) -> Answer:
        monkeypatch.setattr(sys, "argv", ["__main__.py", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        return Answer(int(end.value.code or 0), *capsys.readouterr())

    return call


@pytest.mark.parametrize(
    "command", [[], ["protocol"], ["agreement"], ["places"], ["smoothing"]], ids=" ".join
)
def test_every_command_has_help_and_tells_its_version(study: Study, command: list[str]) -> None:
    answer = study(*command, "--help")
    assert (answer.code, answer.err) == (0, "")
    assert " ".join([f"Usage: {NAME}", *command]) in answer.out
    assert study(*command, "--version") == (0, f"{' '.join([NAME, *command])} {version()}\n", "")


@pytest.mark.parametrize(
    ("option", "known"),
    [
        ("preset", "cpu-cells, cpu-rows, pca"),
        ("scale", "paper"),
        ("method", "trfe"),
        ("experiment", "probe"),
    ],
)
def test_the_protocol_names_what_it_knows(
    study: Study, tmp_path: Path, option: str, known: str
) -> None:
    plural = option if option in ("preset", "scale") else f"{option}s"
    answer = study("protocol", "windows", "--out", tmp_path / "out", f"--{plural}", "foo")
    assert (answer.code, answer.err.count("\n")) == (2, 1)
    assert answer.err.startswith(f"studies.recognition: there is no {option} 'foo'; {option}s: ")
    assert known in answer.err


@pytest.mark.parametrize("command", ["protocol", "agreement"])
def test_a_file_in_the_way_of_the_results_is_named(
    study: Study, tmp_path: Path, command: str
) -> None:
    (tmp_path / "file").write_text("mine")
    answer = study(command, "recordings", "--out", tmp_path / "file")
    assert answer == (
        2,
        "",
        (
            f"studies.recognition: {tmp_path}/file: a folder to write into is "
            "expected, this is a file\n"
        ),
    )


def test_agreement_is_written_as_tables_and_plots(study: Study, tmp_path: Path) -> None:
    cars = [
        Car(1, 0.0, 21.0, 30.0, frames=250),
        Car(2, 40.0, 21.0, 30.0, frames=250),
        Car(3, 20.0, 25.0, 30.0, vy=-0.5, frames=200),
    ]
    write_highd(tmp_path / "data", cars)
    target = tmp_path / "out" / "agreement.md"
    assert study("agreement", tmp_path / "data", "--out", tmp_path / "out") == (
        0,
        f"{target}\n",
        "",
    )
    text = target.read_text()
    assert "| 3 | highway cut in | 1 |" in text and "| 5 | left lane change | 1 |" in text
    for line in text.splitlines():
        if line.startswith("!["):
            assert (tmp_path / "out" / line.split("(")[1].rstrip(")")).stat().st_size > 1000
    assert "![data](data-map.png)" in text


def test_agreement_needs_recordings(study: Study, tmp_path: Path) -> None:
    answer = study("agreement", tmp_path / "nothing", "--out", tmp_path / "out")
    assert (answer.code, answer.err.count("\n")) == (3, 1)
    assert "no such file or folder" in answer.err
