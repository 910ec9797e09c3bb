"""Files that are made to take time or memory: each is answered in seconds, with
bounded memory, in one line.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from schemas import check
from schemas.common.errors import InvalidFile
from schemas.common.storage import read_parquet
from schemas.common.xml import LONGEST_TAG, parse
from tests.runner.files import place, scenario

_SECONDS, _BYTES = 10, 2 * 1024**3
"""Processor time and address space that a command may take for one of these files"""
_LIMITED = f"""
import resource, runpy, sys
resource.setrlimit(resource.RLIMIT_CPU, ({_SECONDS}, {_SECONDS}))
resource.setrlimit(resource.RLIMIT_AS, ({_BYTES}, {_BYTES}))
sys.argv = sys.argv[1:]
runpy.run_module(sys.argv[0], run_name="__main__")
"""
CHECK = ("schemas.xosc_check",)
RUN = ("runner.xosc_run", "--dry-run", "--world", "kinematic")


def limited(command: tuple[str, ...], path: Path) -> tuple[int, list[str]]:
    """Exit code and lines of a command on a file, in a process with limits."""
    call = [sys.executable, "-c", _LIMITED, *command, str(path)]
    done = subprocess.run(call, capture_output=True, text=True, timeout=120, check=False)
    assert "Traceback" not in done.stderr, done.stderr[-2000:]
    return done.returncode, (done.stdout + done.stderr).splitlines()


def changed(old: str, new: Callable[[], str]) -> Callable[[Path], Path]:
    """Writer of a good scenario with a change, whose text is made when it is written."""

    def write(folder: Path) -> Path:
        path = scenario(folder, "bad", stop=0.2)
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new(), 1))
        return path

    return write


def nurbs(folder: Path) -> Path:
    """3,000 control points, kilometres apart."""
    points = "".join(
        f'<ControlPoint weight="1"><Position><WorldPosition x="{100 + i % 7 * 1000}" '
        f'y="{i % 30 * 1000}"/></Position>'
        "</ControlPoint>"
        for i in range(3_000)
    )
    knots = "".join(
        f'<Knot value="{value}"/>' for value in [0] * 3 + list(range(1, 2_998)) + [2_998] * 3
    )
    follow = (
        "<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory "
        'name="P" closed="false"><Shape>'
        f'<Nurbs order="3">{points}{knots}</Nurbs></Shape></Trajectory></TrajectoryRef><TimeReference><None/></TimeReference>'
        "<TrajectoryFollowingMode "
        'followingMode="position"/></FollowTrajectoryAction></RoutingAction></PrivateAction>'
    )
    return scenario(
        folder, "bad", stop=0.2, init=place("Ego", 100, 20, more=follow) + place("Lead", 150, 10)
    )


def parameter(number: int, value: str, kind: str) -> str:
    return f'<ParameterDeclaration name="p{number}" parameterType="{kind}" value="{value}"/>'


FIRST = "<ParameterDeclarations>"


def doubling(count: int, kind: str, last: str) -> str:
    """Declarations of parameters, each of which is twice the next."""
    twice = (parameter(i, f"${{$p{i + 1} + $p{i + 1}}}", kind) for i in range(count))
    return FIRST + "".join(twice) + parameter(count, last, kind)


ATTACKS: dict[str, tuple[Callable[[Path], Path], tuple[str, ...], int]] = {
    "attributes, checked": (
        changed(
            "<Storyboard>",
            lambda: "<Storyboard " + "".join(f' e{i}="x"' for i in range(4000)) + ">",
        ),
        CHECK,
        1,
    ),
    "unknown elements": (changed("<Entities>", lambda: "<Entities>" + "<evil/>" * 10_000), RUN, 0),
    "unknown elements, far inside": (
        changed(
            "<Entities>",
            lambda: (
                "<Entities>" + "<Entities>" * 120 + "<Entities/>" * 10_000 + "</Entities>" * 120
            ),
        ),
        RUN,
        6,
    ),
    "unknown elements of many names": (
        changed(
            "<Storyboard>", lambda: "<Storyboard>" + "".join(f"<Evil{i}/>" for i in range(10_000))
        ),
        RUN,
        0,
    ),
    "namespaces": (
        changed(
            "<Storyboard>",
            lambda: (
                "<Storyboard>" + "".join(f'<q{i}:x xmlns:q{i}="urn:{i}"/>' for i in range(10_000))
            ),
        ),
        RUN,
        0,
    ),
    "doubled attributes": (
        changed("<Storyboard>", lambda: "<Storyboard>" + '<a b="1" b="1"/>' * 100_000),
        CHECK,
        1,
    ),
    "doubled attributes of one tag": (
        changed("<Storyboard>", lambda: "<Storyboard" + ' e="x"' * 100_000 + ">"),
        CHECK,
        1,
    ),
    "a long tag": (
        changed("<Storyboard>", lambda: "<Storyboard" + ' a="x"' * 5_000_000 + ">"),
        RUN,
        3,
    ),
    "a long value": (changed('name="Ego"', lambda: f'name="{"E" * 50_000_000}"'), CHECK, 1),
    "texts that double": (changed(FIRST, lambda: doubling(60, "string", "text")), RUN, 3),
    "numbers that double": (changed(FIRST, lambda: doubling(5000, "double", "1")), RUN, 3),
    "a spline of 3,000 points": (nurbs, RUN, 3),
}


@pytest.mark.slow
@pytest.mark.parametrize("attack", ATTACKS)
def test_an_attack_takes_seconds_and_bounded_memory(attack: str, tmp_path: Path) -> None:
    write, command, code = ATTACKS[attack]
    answer, lines = limited(command, write(tmp_path))
    assert answer in (code, 6 if code == 0 else code), lines[
        -3:
    ]  # a run with elements that were ignored may be inconclusive
    assert len(lines) <= 110
    assert max(map(len, lines)) < 2000


def test_a_long_tag_is_refused_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "long.xosc"
    path.write_text(f'<OpenSCENARIO>\n<a b=">" {"c" * LONGEST_TAG}=""/></OpenSCENARIO>')
    with pytest.raises(InvalidFile, match=r"long.xosc:2: a tag of more than the \d+ bytes"):
        parse(path)


def test_a_long_text_is_no_long_tag(tmp_path: Path) -> None:
    path = tmp_path / "long.xosc"
    path.write_text(f"<OpenSCENARIO>{'x' * (3 * LONGEST_TAG)}<a/></OpenSCENARIO>")
    assert len(parse(path).getroot()) == 1


def test_a_file_that_cannot_be_checked_is_a_problem_and_not_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def exhausted(*_: object) -> None:
        raise MemoryError

    path = scenario(tmp_path)
    monkeypatch.setattr("schemas.checks.checker._problems", exhausted)
    (problem,) = check(path)
    assert problem.level == "error" and "memory" in problem.message


# tables -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "column",
    [
        pa.array([0.0]).take(pa.array([0] * 20_000_000, pa.int32())),
        pa.DictionaryArray.from_arrays(
            pa.array([0] * 100_000, pa.int32()), pa.array(["x" * 100_000])
        ),
        pa.ListArray.from_arrays(
            pa.array([0, 20_000_000], pa.int32()), pa.nulls(20_000_000, pa.float64()).fill_null(0.0)
        ),
    ],
    ids=["numbers", "texts", "a list"],
)
@pytest.mark.parametrize("as_arrow", [True, False])
def test_a_table_that_expands_is_refused(column: pa.Array, as_arrow: bool, tmp_path: Path) -> None:
    path = tmp_path / "bomb.parquet"
    pq.write_table(pa.table({"x": column}), path, compression="zstd", store_schema=as_arrow)
    assert path.stat().st_size < 1_000_000
    with pytest.raises(InvalidFile, match=r"bomb.parquet: the table expands to \d+ bytes"):
        read_parquet(path)


def test_a_sound_table_is_read_as_it_was_written(tmp_path: Path) -> None:
    table = pa.table({"name": ["a", "b", None], "x": [1.0, 2.0, 3.0], "n": [1, 2, 3]})
    pq.write_table(table, tmp_path / "t.parquet")
    assert read_parquet(tmp_path / "t.parquet").equals(table)
    assert read_parquet(tmp_path / "t.parquet", ["x"]).equals(table.select(["x"]))
