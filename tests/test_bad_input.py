"""Bad input of every kind: a run, or one clear line and the right exit code; see
`benchmarks/fuzz.py` for thousands more.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from random import Random

import pytest

from runner import xosc_run
from schemas import check
from schemas.common.storage import MAX_BYTES
from tests.mutation import BOMB, EXTERNAL, OWN_SCENARIOS, sources, write_mutant
from tests.runner.files import HEADER, ROADS, car, place, scenario, speed_action, story

Fault = Callable[[Path], Path]
"""Writes bad files into a folder and returns the one to be run"""
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    """Exit code, standard output and standard error of the command on files."""

    def call(*paths: Path) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "path", list(sys.path))
        monkeypatch.setattr(
            sys, "argv", ["xosc-run", "--world", "kinematic", "--max-time", "3", *map(str, paths)]
        )
        with pytest.raises(SystemExit) as end:
            xosc_run.main()
        return int(end.value.code or 0), *capsys.readouterr()

    return call


# how bad files come about -------------------------------------------------------------------


def text(content: str | bytes) -> Fault:
    """A scenario file of that content."""

    def write(folder: Path) -> Path:
        path = folder / "bad.xosc"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def changed(old: str, new: str) -> Fault:
    """A good scenario with a fault."""

    def write(folder: Path) -> Path:
        path = scenario(folder, "bad", stop=0.2)
        content = path.read_text()
        assert old in content
        path.write_text(content.replace(old, new, 1))
        return path

    return write


def with_road(old: str, new: str) -> Fault:
    """A good scenario whose road file has a fault."""

    def write(folder: Path) -> Path:
        path = scenario(folder, "bad", stop=0.2)
        content = (ROADS / "straight.xodr").read_text()
        assert old in content
        (folder / "straight.xodr").write_text(content.replace(old, new))
        return path

    return write


def a_folder(folder: Path) -> Path:
    (folder / "bad.xosc").mkdir()
    return folder / "bad.xosc"


def a_pipe(folder: Path) -> Path:
    os.mkfifo(folder / "bad.xosc")
    return folder / "bad.xosc"


def catalogue_cycle(folder: Path) -> Path:
    """A vehicle that is its own trailer."""
    entry = car("Loop").replace('<ScenarioObject name="Loop">', "").replace("</ScenarioObject>", "")
    loop = (
        '<TrailerHitch dx="0"/><Trailer><CatalogReference catalogName="loops" '
        'entryName="car"/></Trailer></Vehicle>'
    )
    catalogue = f'<Catalog name="loops">{entry.replace("</Vehicle>", loop)}</Catalog>'
    (folder / "catalogs").mkdir()
    (folder / "catalogs" / "loops.xosc").write_text(
        f"<OpenSCENARIO>{HEADER}{catalogue}</OpenSCENARIO>"
    )
    path = scenario(folder, "bad")
    locations = (
        "<CatalogLocations><VehicleCatalog><Directory "
        'path="catalogs"/></VehicleCatalog></CatalogLocations>'
    )
    looping = (
        '<ScenarioObject name="Loop"><CatalogReference catalogName="loops" '
        'entryName="car"/></ScenarioObject></Entities>'
    )
    path.write_text(
        path.read_text().replace("<CatalogLocations/>", locations).replace("</Entities>", looping)
    )
    return path


def parameter_cycle(folder: Path) -> Path:
    path = scenario(folder, "bad")
    cycle = "".join(
        f'<ParameterDeclaration name="{name}" parameterType="double" value="${{2 * ${other}}}"/>'
        for name, other in ("AB", "BA")
    )
    path.write_text(
        path.read_text().replace("</ParameterDeclarations>", f"{cycle}</ParameterDeclarations>")
    )
    return path


def faster_than_numbers(folder: Path) -> Path:
    in_the_field = place("Lead", 0, 0).replace(
        'LanePosition roadId="1" laneId="-1" s="0"', 'WorldPosition x="0" y="900"'
    )
    stories = story("Lead", [(0.1, speed_action(1e308))])
    return scenario(
        folder, "bad", stop=1.0, init=place("Ego", 100, 20) + in_the_field, stories=stories
    )


NESTED = f"<OpenSCENARIO>{'<Story>' * 100_000}{'</Story>' * 100_000}</OpenSCENARIO>"
AGES = 's="${pow(10, pow(10, pow(10, 10)))}" was="'

ATTACKS: dict[str, tuple[Fault, int, str]] = {
    "empty file": (text(""), 3, "bad.xosc:1: the file is empty"),
    "blank file": (text("\n \n"), 3, "bad.xosc:1: the file is empty"),
    "binary": (text(Random(0).randbytes(5000)), 3, "bad.xosc"),
    "zeros": (text(b"\0" * 5000), 3, "bad.xosc"),
    "other XML": (text("\n<html/>"), 3, "bad.xosc:2: "),
    "road file as a scenario": (
        text("<OpenDRIVE><header revMajor='1' revMinor='6'/></OpenDRIVE>"),
        3,
        "bad.xosc:1: ",
    ),
    "folder": (a_folder, 2, "bad.xosc: this stands for no .xosc or .xodr file"),
    "pipe": (a_pipe, 3, "bad.xosc: this is not a regular file"),
    "billion laughs": (
        text(f'{BOMB}\n<OpenSCENARIO a="&c;">&c;</OpenSCENARIO>'),
        3,
        "bad.xosc:1: a document type",
    ),
    "external entity": (
        text(f"\n{EXTERNAL}<OpenSCENARIO>&c;</OpenSCENARIO>"),
        3,
        "bad.xosc:2: a document type",
    ),
    "entity that nobody declares": (
        text("<OpenSCENARIO>\n&c;</OpenSCENARIO>"),
        3,
        "bad.xosc:2: not well-formed",
    ),
    "deep nesting": (text(NESTED), 3, "bad.xosc:1: not well-formed"),
    "wrong encoding": (
        text(b'<?xml version="1.0" encoding="UTF-16"?><OpenSCENARIO/>'),
        3,
        "bad.xosc",
    ),
    "unknown encoding": (
        text('<?xml version="1.0" encoding="klingon"?><OpenSCENARIO/>'),
        3,
        "bad.xosc:1",
    ),
    "catalogue cycle": (catalogue_cycle, 3, "loops.xosc:"),
    "parameter cycle": (parameter_cycle, 3, "depends on itself"),
    "faster than numbers": (
        faster_than_numbers,
        3,
        ": Vehicle: 'Lead' moves too fast for a number",
    ),
    "no road file": (changed("straight.xodr", "nowhere.xodr"), 3, "nowhere.xodr"),
    "road of no length": (with_road('length="1000', 'length="NaN" was="'), 3, "straight.xodr:"),
    "road of negative length": (with_road('length="1000', 'length="-1000'), 3, "straight.xodr:"),
    "road of infinite length": (
        with_road('length="1000', 'length="INF" was="'),
        3,
        "straight.xodr:",
    ),
    "road that begins nowhere": (with_road('x="0" y="0"', 'x="NaN" y="0"'), 3, "straight.xodr:"),
    "road file that is none": (with_road("OpenDRIVE", "OpenCRG"), 3, "straight.xodr:"),
    "device as road file": (changed("straight.xodr", "/dev/zero"), 3, "not a regular file"),
    "scenario as its own road file": (changed("straight.xodr", "bad.xosc"), 3, "bad.xosc"),
    "position that is no number": (changed(' s="', ' s="NaN" was="'), 3, "bad.xosc:"),
    "lane that is not there": (changed('laneId="-1"', 'laneId="-9"'), 3, "bad.xosc:"),
    "vehicle of negative length": (changed('length="5"', 'length="-5"'), 3, "bad.xosc:"),
    "expression that takes ages": (changed(' s="', f" {AGES}"), 3, "bad.xosc:"),
    "reference to nobody": (changed('entityRef="Ego"', 'entityRef="Egon"'), 3, "bad.xosc:"),
    "escape sequence in a name": (
        changed('entityRef="Ego"', 'entityRef="&#x9b;31m"'),
        3,
        "bad.xosc:",
    ),
}


@pytest.mark.parametrize("attack", ATTACKS)
def test_an_attack_is_answered_in_one_line_with_its_file(
    attack: str, run: Run, tmp_path: Path
) -> None:
    write, code, words = ATTACKS[attack]
    answer, _, error = run(write(tmp_path))
    assert (answer, error.count("\n")) == (code, 1), error
    assert error.startswith("xosc-run: /")
    assert words in error
    assert error.rstrip("\n").isprintable()
    assert len(error) < 1000


def test_what_another_file_holds_is_not_shown(run: Run, tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("password")
    declared = EXTERNAL.replace("/etc/passwd", str(tmp_path / "secret"))
    assert "password" not in "".join(
        map(str, run(text(f"{declared}<OpenSCENARIO>&c;</OpenSCENARIO>")(tmp_path)))
    )


def test_bad_files_do_not_stop_good_ones(run: Run, tmp_path: Path) -> None:
    code, out, _ = run(text(BOMB)(tmp_path), scenario(tmp_path, "good", stop=0.2))
    assert code == 3
    assert re.search(r"PASSED +good", out)


def test_a_file_that_is_too_large_is_refused_by_its_size(tmp_path: Path) -> None:
    path = tmp_path / "large.xosc"
    with path.open("wb") as file:
        file.truncate(MAX_BYTES + 1)
    limit = f"import resource; resource.setrlimit(resource.RLIMIT_AS, ({MAX_BYTES}, {MAX_BYTES})); "
    code = (
        f"{limit}import sys; sys.argv = ['xosc-run', {str(path)!r}]; from runner.xosc_run import "
        "main; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stderr) == (
        3,
        f"xosc-run: {path}: the file has {MAX_BYTES + 1} bytes, at most {MAX_BYTES} are read\n",
    )


# mutants ------------------------------------------------------------------------------------


@pytest.mark.slow
def test_mutants_can_be_checked(tmp_path: Path) -> None:
    found = sources(OWN_SCENARIOS)
    for number in range(60):
        random = Random(number)
        mutant = write_mutant(random.choice(found), tmp_path / str(number), random)
        if mutant.path.exists():
            assert all("\n" not in problem.message for problem in check(mutant.path)), (
                mutant.changes
            )


def test_a_mutant_can_be_made_again(tmp_path: Path) -> None:
    source = sources(OWN_SCENARIOS)[0]
    for number in range(20):
        first, again = (
            write_mutant(source, tmp_path / f"{name}{number}", Random(number))
            for name in ("a", "b")
        )
        assert first.changes == again.changes
        assert not first.path.is_file() or first.path.read_bytes() == again.path.read_bytes()
