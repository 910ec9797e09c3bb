"""Systems under test in a process of their own: the same results as in this one, and whatever they
do is an error of theirs.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import runner
from runner.batch.batch import run_batch
from runner.batch.jobs import jobs_of
from runner.batch.outputs.tables import write_parquet
from runner.judging.settings import RunSettings
from runner.systems import open_system
from runner.systems.base import SystemUnderTestError, parameters_of
from runner.systems.isolation import boundary
from schemas.common.errors import UsageError
from tests.commands import Command
from tests.mutation import REPOSITORY
from tests.runner.files import distribution, scenario

LIBRARY = REPOSITORY / "xosc" / "library"
SOURCE = '''
import argparse
import os
import signal
import sys
import threading
import time
from datetime import timezone
from runner.systems import Control, Pose, WorldDriven

BUILT = []

class Own(BaseException):
    pass

class Fine:
    """Writes all that it sees into its reasons, and drives by it."""

    def __init__(self, gain: float = 0.5, name: str = "x") -> None:
        self.gain, self.name = gain, name
        BUILT.append(self)

    def reset(self, ego, timestep, seed):
        self.count, self.seed = 0, seed
        print("reset")

    def control(self, seen, dt):
        self.count += 1
        if self.count == 5:
            answer = self.act()
            if answer is not None:
                return answer
        network = seen.network
        at = network.locate(seen.ego.x, seen.ego.y, seen.ego.z, seen.ego.h) if network is not None else None
        everyone = [
            one._asdict() | {"lights": dict(one.lights), "overrides": dict(one.overrides)} for one in (seen.ego, *seen.others)
        ]
        told = repr((seen.time, everyone, seen.target_speed, at, dict(seen.environment.weather), dt))
        return Control(self.gain * (seen.target_speed - 2.0 - seen.ego.speed), None, told)

    def act(self):
        pass

class Exit(Fine):
    def act(self): sys.exit(0)

class HardExit(Fine):
    def act(self): os._exit(0)

class Raise(Fine):
    def act(self): raise Own("of its own")

class Interrupt(Fine):
    def act(self): raise KeyboardInterrupt

class Fork(Fine):
    # The copy answers first: on a busy machine the run would be over before it.
    def act(self): os.fork() and time.sleep(2.0)

class ForkAndExit(Fine):
    def act(self):
        if os.fork() == 0:
            time.sleep(600)
        os._exit(3)

class Hang(Fine):
    def act(self):
        while True: pass

class Memory(Fine):
    def act(self):
        import resource
        resource.setrlimit(resource.RLIMIT_AS, (2**30, 2**30))
        bytearray(2**33)

class CloseAll(Fine):
    def act(self): os.closerange(0, 64)

class CloseStreams(Fine):
    def act(self):
        for stream in (sys.stdin, sys.stdout, sys.stderr):
            stream.close()

class Print(Fine):
    def act(self):
        print("printed")
        os.write(1, b"written")

class Parse(Fine):
    def act(self): argparse.ArgumentParser().parse_args()

class Crash(Fine):
    def act(self): os.kill(os.getpid(), signal.SIGSEGV)

class Later(Fine):
    def act(self):
        threading.Thread(target=lambda: os._exit(4)).start()
        time.sleep(0.3)

class Unclosed(Fine):
    def close(self): raise ValueError("still open")

class ExitAtEnd(Fine):
    def close(self): os._exit(0)

class ExitAtReset(Fine):
    def reset(self, ego, timestep, seed): sys.exit()

class NoNumbers(Fine):
    def act(self): return Control(acceleration="full")

class NoText(Fine):
    def act(self): return Control(reason=5)

class Path(Fine):
    def control(self, seen, dt):
        return Pose(seen.ego.x + dt * seen.ego.speed, seen.ego.y, seen.ego.h, reason="as before")

class Counts(Fine):
    def control(self, seen, dt):
        return Control(reason=f"{os.getpid()} {len(BUILT)}")

class Unbuilt(Fine):
    def __init__(self): sys.exit(7)

class World(WorldDriven):
    pass
'''


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A working folder with the classes."""
    place, before = tmp_path_factory.mktemp("boundary"), Path.cwd()
    (place / "foreign_systems.py").write_text(SOURCE)
    (place / "ends_import.py").write_text("import sys\nsys.exit(0)\n")
    os.chdir(place)
    yield place
    boundary.release()
    os.chdir(before)


def run(path: Path, name: str, **how: object) -> runner.RunResult:
    settings = {"world": "kinematic", "sut_timeout": 20.0, "end_after_collision": False} | how
    return runner.run(path, sut=f"foreign_systems:{name}", **settings)  # type: ignore[arg-type]


@pytest.mark.parametrize("file", ["scenario", "simple_cut_in"])
@pytest.mark.parametrize("name", ["Fine:gain=0.3", "Path"])
def test_results_are_the_same_bytes_as_in_this_process(
    file: str, name: str, folder: Path, tmp_path: Path
) -> None:
    path = LIBRARY / f"{file}.xosc" if file != "scenario" else scenario(folder, stop=2)
    outside = run(path, name, max_time=4.0)
    inside = run(path, name, max_time=4.0, sut_in_process=True)
    write_parquet(outside, tmp_path / "outside")
    write_parquet(inside, tmp_path / "inside")
    assert (tmp_path / "outside").read_bytes() == (tmp_path / "inside").read_bytes()
    assert outside.events == inside.events
    assert outside.remarks == inside.remarks
    assert outside.sut == inside.sut
    assert outside.sut_parameters == inside.sut_parameters
    assert outside.settings == inside.settings


FAILURES = {
    "Exit": r"SystemExit: 0 \(.*foreign_systems.py:\d+\)",
    "HardExit": "its process ended with code 0 before it had answered",
    "Raise": r"Own: of its own \(.*foreign_systems.py:\d+\)",
    "Interrupt": "KeyboardInterrupt",
    "Fork": "a copy of its process",
    "ForkAndExit": "its process ended with code 3",
    "CloseAll": "its process ended with code 1|has closed its files",
    "Crash": "its process was ended by SIGSEGV",
    "Later": "its process ended with code 4",
    "Unclosed": r"ValueError: still open",
    "ExitAtEnd": "its process ended with code 0",
    "ExitAtReset": "SystemExit",
    "NoNumbers": r"TypeError: control\(\) returned .*, numbers are expected",
    "NoText": "a text is expected as reason",
    "Memory": "MemoryError.*: this takes more memory than there is",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FAILURES)
def test_what_a_class_does_is_its_own_error(name: str, folder: Path) -> None:
    with pytest.raises(SystemUnderTestError, match=FAILURES[name]) as error:
        run(scenario(folder), name)
    assert str(error.value).startswith(f"the system under test foreign_systems:{name} failed at ")
    assert error.value.exit_code == 5


def test_the_end_of_its_process_is_told_with_the_name(folder: Path, command: Command) -> None:
    path = scenario(folder)
    answer = command("xosc-run", path, "--sut", "foreign_systems:HardExit", "--world", "kinematic")
    assert answer.code == 5
    assert "ERROR        scenario" in answer.out
    assert "the system under test failed" in answer.out
    assert answer.err.endswith(
        "xosc-run: the system under test foreign_systems:HardExit failed at 0.20 s: "
        "its process ended with code 0 before it had answered\n"
    )
    assert "internal error" not in answer.out + answer.err


def test_a_class_that_does_not_answer_is_ended(folder: Path) -> None:
    path = scenario(folder)
    run(path, "Fine", max_time=0.1)  # its process is there
    begun = time.monotonic()
    with pytest.raises(
        SystemUnderTestError,
        match=r"no answer within 0.5 s \(--sut-timeout\); its process was ended",
    ):
        run(path, "Hang", sut_timeout=0.5)
    assert time.monotonic() - begun < 10.0


@pytest.mark.parametrize("name", ["CloseStreams", "Print", "Parse"])
def test_streams_and_command_line_are_its_own(
    name: str, folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    result = run(scenario(folder), name)
    assert result.status == "completed"
    boundary.release()  # all that it has printed is there then
    captured = capfd.readouterr()
    assert captured.out == ""
    assert "reset" in captured.err
    assert ("printed" in captured.err) == (name == "Print")


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("foreign_systems:Absent", "can't be imported: it has no class 'Absent'"),
        ("foreign_systems:Fine:gain=high", "parameter gain of 'foreign_systems:Fine' is a number"),
        ("foreign_systems:Fine:lidar=1", "no parameter 'lidar'; there are: gain, name"),
        ("foreign_systems:BUILT", "is not a class"),
        ("ends_import:Anything", "can't be imported: SystemExit"),
        ("foreign_systems.py:Absent", "can't be imported: it has no class 'Absent'"),
        ("absent.py:Absent", "absent.py: there is no such file"),
    ],
)
def test_names_are_checked_before_runs(name: str, complaint: str) -> None:
    with pytest.raises(UsageError, match=complaint):
        RunSettings(sut=name)


def test_a_class_that_can_not_be_built_is_named(folder: Path) -> None:
    with pytest.raises(UsageError, match="'foreign_systems:Unbuilt' can't be built: SystemExit: 7"):
        run(scenario(folder), "Unbuilt")


def test_a_class_in_a_file_is_named_by_the_path(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "beside.py").write_text("GAIN = 0.25\n")
    source = "from beside import GAIN\nfrom foreign import Fine\n"
    (tmp_path / "foreign.py").write_text(SOURCE)
    (tmp_path / "in file.py").write_text(f"{source}\nclass Mine(Fine):\n    pass\n")
    path = scenario(folder)
    result = runner.run(
        path, sut=f"{tmp_path}/in file.py:Mine:gain=0.25", world="kinematic", max_time=0.5
    )
    assert result.sut_parameters == {"gain": 0.25, "name": "x"}


def test_one_process_serves_all_runs_and_each_has_its_own_instance(folder: Path) -> None:
    path = scenario(folder)
    boundary.release()

    def told() -> list[str]:
        result = run(path, "Counts", max_time=0.2)
        return [entry.text for entry in result.events if entry.kind == "interventionStart"]

    def process() -> tuple[int, int]:
        system = open_system("foreign_systems:Fine", False, 20.0)
        assert isinstance(system, boundary.IsolatedSystem)
        number = system._process._process.pid
        system.close()
        return number, len(boundary._idle)

    assert process() == process()
    assert told() == told() == []


def test_a_class_for_the_worlds_own_driver_runs_there_too() -> None:
    system = open_system("foreign_systems:World", False, 20.0)
    assert isinstance(system, boundary.IsolatedDriver)
    assert parameters_of(system) == {}
    system.close()


@pytest.mark.slow
def test_a_batch_in_two_processes_has_one_child_a_worker_and_the_same_bytes(
    folder: Path, tmp_path: Path
) -> None:
    scenario(folder)
    variation = distribution(folder, "variation", {"Gap": (20, 60, 5)})

    def tables(processes: int, **how: bool) -> dict[str, bytes]:
        out = tmp_path / f"{processes}{how}"
        settings = RunSettings(
            sut="foreign_systems:Fine", world="kinematic", sut_timeout=30.0, **how
        )
        outcomes = list(
            run_batch(jobs_of([variation], {}, True), settings, out=out, processes=processes)
        )
        assert len(outcomes) == 9
        assert {outcome.state for outcome in outcomes} <= {"passed", "failed", "inconclusive"}
        return {path.parent.name: path.read_bytes() for path in out.glob("*/trajectories.parquet")}

    assert tables(1) == tables(2) == tables(1, sut_in_process=True)


def test_nothing_is_left_when_a_run_is_interrupted(folder: Path) -> None:
    system = open_system("foreign_systems:Fine", False, 20.0)
    assert isinstance(system, boundary.IsolatedSystem)
    number = system._process._process.pid
    system._process.end(at_once=True)
    with pytest.raises(ProcessLookupError):
        os.killpg(number, 0)
