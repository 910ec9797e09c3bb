"""FMUs as systems under test: FMI 2 and 3, mapping files, OSMP, what is wrong
with them, and runs one after another.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

import runner
from runner.batch.inputs import plugged_in
from runner.judging.settings import RunSettings
from runner.systems import Control
from runner.systems.kinds.commanded import Scripted
from schemas.common.errors import InvalidFile, ToolchainError, Unsupported, UsageError
from tests.commands import Command
from tests.conformance.support import at, events, track
from tests.runner.files import distribution, scenario
from tests.runner.systems.outside.fmu import COMPILER, fmu

pytest.importorskip("fmpy")
if COMPILER is None:
    pytest.skip("no C compiler: FMUs are compiled", allow_module_level=True)

ACC = """
[inputs]
v_ego = "ego.speed"
v_set = { field = "target_speed", factor = 0.5 }
gap = { field = "lead.gap", absent = 500.0 }
[outputs]
acceleration = "a_demand"
"""
PEDALS = ACC.replace('acceleration = "a_demand"', 'throttle = "gas_pedal"\nbrake = "brake_pedal"')
POSE = '[inputs]\nv_ego = { field = "time", factor = 0.0, absent = 0.0 }\n'


@pytest.fixture(autouse=True, scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    patch = pytest.MonkeyPatch()
    patch.setenv("XOSC_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))


def run(file: Path, sut: object, **settings: object) -> runner.RunResult:
    return runner.run(file, world="kinematic", sut=f"fmu:{sut}", **settings)  # type: ignore[arg-type]


# driving ------------------------------------------------------------------------------------


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("mapping", [ACC, PEDALS])
def test_it_drives_by_its_outputs(tmp_path: Path, version: int, mapping: str) -> None:
    ego = track(run(scenario(tmp_path, stop=1.0), fmu(tmp_path, version, mapping=mapping)), "Ego")
    speed = 20.0
    for _ in range(20):
        speed += 0.05 * 0.5 * (10.0 - speed)
    assert at(ego, 1.0, "speed") == pytest.approx(speed)


def test_the_gap_is_that_between_the_boxes_and_parameters_are_set(tmp_path: Path) -> None:
    """Headway 3 s at 20 m/s: 60 m, and the lead is 45 m ahead: it brakes by 3
    m/s² from the beginning.
    """
    near = fmu(tmp_path, mapping=ACC + "[parameters]\nheadway = 2.26\n")
    far = fmu(tmp_path, mapping=ACC + "[parameters]\nheadway = 2.24\n", name="far")
    file = scenario(tmp_path, stop=0.1)
    assert at(track(run(file, near), "Ego"), 0.05, "acceleration") == pytest.approx(-3.0)
    assert at(track(run(file, far), "Ego"), 0.05, "acceleration") == pytest.approx(-5.0)


def test_factors_change_the_units_of_inputs_and_of_outputs(tmp_path: Path) -> None:
    """The demand for 10 m/s is -3 m/s²; half of it is driven, and an input of 2
    v_set / 2 is the same speed as v_set.
    """
    halved = ACC.replace(
        'acceleration = "a_demand"', 'acceleration = { variable = "a_demand", factor = 0.5 }'
    )
    assert halved != ACC
    file = scenario(tmp_path, stop=0.1)
    whole, half = (
        track(run(file, fmu(tmp_path, mapping=each, name=name)), "Ego")
        for each, name in ((ACC, "one"), (halved, "two"))
    )
    assert (
        at(half, 0.05, "acceleration")
        == pytest.approx(0.5 * at(whole, 0.05, "acceleration"))
        != 0.0
    )


def test_where_it_is_not_active_the_ego_drives_as_scripted(tmp_path: Path) -> None:
    mapping = (
        ACC.replace("v_set =", 'on = "others[0].present"\nv_set =')
        + 'active = "engaged"\n[parameters]\nheadway = 2.0\n'
    )
    result = run(scenario(tmp_path, stop=1.5), fmu(tmp_path, mapping=mapping))
    ego = track(result, "Ego")
    assert at(ego, 0.45, "speed") == 20.0 and at(ego, 1.5, "speed") < 19.0
    assert [event.time for event in events(result, "interventionStart")] == [
        pytest.approx(0.5, abs=0.06)
    ]


def test_it_drives_by_poses_each_run_from_the_beginning(tmp_path: Path) -> None:
    mapping = (
        '[inputs]\nv_ego = "ego.speed"\n[outputs]\nx = "x"\ny = "y"\nh = '
        '"h"\n[parameters]\nx_start = 100.0\ny_start = -1.75\n'
    )
    file, system = scenario(tmp_path, stop=1.0), fmu(tmp_path, mapping=mapping)
    results = [run(file, system) for _ in range(2)]
    ego = track(results[0], "Ego")
    assert (
        at(ego, 1.0, "x") - at(ego, 0.0, "x") == pytest.approx(20.0)
        and results[0].verdict.outcome == "passed"
    )
    assert results[0].trajectories.equals(results[1].trajectories)


@pytest.mark.slow
def test_a_batch_gives_the_same_in_one_process_and_in_two(tmp_path: Path, command: Command) -> None:
    scenario(tmp_path, stop=0.5)
    file, system = (
        distribution(tmp_path, "gaps", {"Gap": (20.0, 50.0, 10.0)}),
        fmu(tmp_path, 3, mapping=ACC),
    )
    for jobs in ("1", "2"):
        arguments = (
            "--sut",
            f"fmu:{system}",
            "--world",
            "kinematic",
            "--jobs",
            jobs,
            "--out",
            tmp_path / jobs,
        )
        assert command("xosc-run", *arguments, file).code == 0
    both = [
        {
            each.relative_to(tmp_path / jobs): each.read_bytes()
            for each in (tmp_path / jobs).rglob("*.csv")
        }
        for jobs in "12"
    ]
    assert len(both[0]) == 4 and both[0] == both[1]


def test_the_digest_of_a_run_is_that_of_its_files(tmp_path: Path) -> None:
    settings = RunSettings(sut=f"fmu:{fmu(tmp_path, mapping=ACC)}")
    before = plugged_in(settings)
    fmu(tmp_path, mapping=PEDALS)
    assert len(before) > 10 and plugged_in(settings) != before


# OSMP ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("initialised", [False, True])
def test_osmp_takes_sensor_views_and_gives_traffic_updates(
    tmp_path: Path, version: int, initialised: bool
) -> None:
    pytest.importorskip("osi3")
    names = [
        "OSMPSensorViewIn",
        "OSMPTrafficUpdateOut",
        *(["OSMPGroundTruthInit"] if initialised else []),
    ]
    result = run(scenario(tmp_path, stop=1.0), fmu(tmp_path, version, names))
    ego = track(result, "Ego")
    assert at(ego, 1.0, "x") - at(ego, 0.0, "x") == pytest.approx(19.0) and at(ego, 1.0, "y") == at(
        ego, 0.0, "y"
    )
    assert set(ego["speed"][1:]) == {19.0} and result.verdict.outcome == "passed"


@pytest.mark.parametrize("version", [2, 3])
def test_osmp_gives_motion_requests(tmp_path: Path, version: int) -> None:
    pytest.importorskip("osi3")
    file = scenario(tmp_path, stop=1.0)
    ego = track(run(file, fmu(tmp_path, version, ["OSMPMotionRequestOut"])), "Ego")
    assert at(ego, 1.0, "x") == pytest.approx(118.0) and at(ego, 1.0, "speed") == pytest.approx(
        18.0
    )


def test_osmp_that_is_no_message_ends_the_run(tmp_path: Path) -> None:
    pytest.importorskip("osi3")
    system = fmu(
        tmp_path, 2, ["OSMPSensorViewIn", "OSMPTrafficUpdateOut"], "[parameters]\nfail = 4\n"
    )
    with pytest.raises(
        ToolchainError, match=r"ego\.fmu: the FMU gives 20 bytes that are no TrafficUpdate"
    ):
        run(scenario(tmp_path), system)


# what is wrong ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fail", "version", "complaint"),
    [
        (1, 2, r"the FMU fails at 0\.55 s: fmi2DoStep answers discard$"),
        (
            2,
            2,
            (
                r"the FMU fails at 0\.55 s: fmi2DoStep answers error; its log says 'the plant has "
                r"no solution'$"
            ),
        ),
        (
            2,
            3,
            (
                r"the FMU fails at 0\.55 s: fmi3DoStep answers error; its log says 'the plant has "
                r"no solution'$"
            ),
        ),
        (3, 2, r"the FMU gives nan as acceleration \(a_demand\) at 0\.05 s$"),
        (6, 3, r"the FMU fails at 0\.00 s: it asks to end the simulation$"),
    ],
)
def test_one_that_fails_ends_the_run_with_one_line(
    tmp_path: Path, fail: int, version: int, complaint: str
) -> None:
    system = fmu(tmp_path, version, mapping=f"{ACC}[parameters]\nfail = {fail}\n")
    with pytest.raises(ToolchainError, match=rf"ego\.fmu: {complaint}") as error:
        run(scenario(tmp_path, stop=1.0), system)
    assert "\n" not in str(error.value) and error.value.exit_code == 5


@pytest.mark.parametrize(
    ("changes", "kind", "complaint"),
    [
        ({"kind": "ModelExchange"}, Unsupported, "this FMU is not for co-simulation"),
        (
            {"platform": "riscv99"},
            Unsupported,
            r"this FMU has no binary for \w+; there are riscv99",
        ),
        (
            {"text": "<fmiModelDescription"},
            InvalidFile,
            r"the modelDescription\.xml can't be read: ",
        ),
        (
            {"text": '<fmiModelDescription fmiVersion="4.0"/>'},
            InvalidFile,
            r"the modelDescription\.xml can't be read: ",
        ),
    ],
)
def test_fmus_that_can_not_be_run_are_refused(
    tmp_path: Path, changes: dict[str, str], kind: type, complaint: str
) -> None:
    with pytest.raises(kind, match=rf"ego\.fmu: {complaint}"):
        run(scenario(tmp_path), fmu(tmp_path, mapping=ACC, **changes))


def test_files_that_are_no_fmu_are_refused(tmp_path: Path, command: Command) -> None:
    (tmp_path / "text.fmu").write_text("no zip")
    for name, complaint in (
        ("text.fmu", "this is no FMU: a zip archive"),
        ("absent.fmu", "no such file"),
    ):
        with pytest.raises(InvalidFile, match=complaint):
            run(scenario(tmp_path), tmp_path / name)
    with pytest.raises(UsageError, match=r"needs a file: fmu:FILE\.fmu"):
        runner.run(scenario(tmp_path), sut="fmu")
    answer = command("xosc-run", "--sut", f"fmu:{tmp_path / 'text.fmu'}", scenario(tmp_path))
    assert answer.code == 3 and answer.err.count("\n") == 1


@pytest.mark.parametrize(
    ("mapping", "complaint"),
    [
        ("[inputs", "this is no TOML"),
        ("[in]\n", r"the tables \[inputs\], \[outputs\], \[parameters\] are expected, not 'in'"),
        (
            '[inputs]\nv = "ego.speed"\n',
            "the FMU has no variable 'v'; of causality input there are gap, on, v_ego, v_set",
        ),
        ('[inputs]\na_demand = "ego.speed"\n', "'a_demand' is of causality output, not input"),
        (
            '[inputs]\nv_ego = "ego.colour"\n',
            "there is no field 'ego.colour'; there are time, dt, target_speed, stop_distance,",
        ),
        ('[inputs]\nv_ego = "lead"\n', "there is no field 'lead'"),
        ("[inputs]\nv_ego = 3\n", r"'v_ego' is a text, or \{ absent = …, factor = …, field = … \}"),
        (
            '[inputs]\nv_ego = { field = "time", factor = "3" }\n',
            "'v_ego': factor is a number, not '3'",
        ),
        (
            '[outputs]\nspin = "a_demand"\n',
            "there is no field 'spin'; there are acceleration, throttle",
        ),
        ('[outputs]\nx = "x"\n', "a pose, which is x, y and h"),
        ('[outputs]\nx = "x"\ny = "y"\nh = "h"\nsteering = "h"\n', "and no pedals"),
        (
            '[outputs]\nacceleration = "a_demand"\nbrake = "brake_pedal"\n',
            "acceleration, and throttle or brake beside it",
        ),
        (
            '[outputs]\nacceleration = "a_demand"\n[parameters]\nfail = "x"\n',
            "'fail' is of type Integer, not 'x'",
        ),
    ],
)
def test_what_is_wrong_in_a_mapping_is_named(tmp_path: Path, mapping: str, complaint: str) -> None:
    with pytest.raises(InvalidFile, match=rf"ego\.toml: .*{complaint}"):
        run(scenario(tmp_path), fmu(tmp_path, mapping=mapping))


def test_one_without_a_mapping_says_nothing_of_the_ego(tmp_path: Path) -> None:
    with pytest.raises(
        UsageError, match=r"nothing says what the ego does: .*ego\.toml has no \[outputs\]"
    ):
        run(scenario(tmp_path), fmu(tmp_path))
    with pytest.raises(InvalidFile, match="takes OSMPSensorDataIn"):
        run(scenario(tmp_path), fmu(tmp_path, 2, ["OSMPSensorDataIn", "OSMPTrafficUpdateOut"]))


def test_native_code_is_refused_where_files_are_not_trusted(
    tmp_path: Path, command: Command
) -> None:
    system = fmu(tmp_path, mapping=ACC)
    answer = command("xosc-run", "--untrusted", "--sut", f"fmu:{system}", scenario(tmp_path))
    assert answer.code == 2 and "--untrusted loads no code but the toolchain's own" in answer.err


def test_another_mapping_file_may_be_named(tmp_path: Path) -> None:
    system = fmu(tmp_path)
    (tmp_path / "acc.toml").write_text(ACC)
    result = runner.run(
        scenario(tmp_path, stop=0.1),
        world="kinematic",
        sut=f"fmu:{system},mapping={tmp_path / 'acc.toml'}",
    )
    same = Scripted(
        [(0.0, Control(acceleration=-5.0)), (0.05, Control(acceleration=0.5 * (10.0 - 19.75)))]
    )
    assert result.trajectories.equals(
        runner.run(scenario(tmp_path, stop=0.1), world="kinematic", sut=same).trajectories
    )
    assert os.environ["XOSC_CACHE_DIR"] in str(
        next(Path(os.environ["XOSC_CACHE_DIR"]).glob("fmu/*"))
    )
