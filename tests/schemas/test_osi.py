"""OSI traces in `xosc-check`: rules of the messages and of multi-channel files."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

import runner
import xosc
from runner.exchange.exports import osi
from schemas import check, xosc_check
from schemas.checks.osi import MOST, READABLE, all_osi_rules
from tests.runner.exchange.test_traces import mcap, truths, write

pytest.importorskip("osi3", reason="the extra `osi` is not installed")

LIBRARY = Path(xosc.__file__).parent / "library"


@pytest.mark.parametrize("suffix", osi.FORMATS)
@pytest.mark.parametrize(
    "name", ["roundabout_exiting", "intersection_pedestrian_crossing", "ramp_entering_highway"]
)
def test_our_own_traces_are_sound(name: str, suffix: str, tmp_path: Path) -> None:
    result = runner.run(
        LIBRARY / f"{name}.xosc", world="kinematic", timestep=0.5, sut="none", max_time=10.0
    )
    osi.write_trace(result, tmp_path / f"trace{suffix}")
    assert check(tmp_path / f"trace{suffix}") == []


def test_a_problem_of_all_messages_is_told_once(tmp_path: Path) -> None:
    path = write(tmp_path / "trace.osi", [each.SerializeToString() for each in truths()])
    found = [str(each) for each in check(path) if each.rule.endswith("groundtruth.version.is_set")]
    assert found == [f"{path}: error: message 1 and 19 more: version is not set"]


def test_multi_channel_files_have_metadata(tmp_path: Path) -> None:
    found = {
        each.rule.rpartition(".")[2]: each.message
        for each in check(mcap(tmp_path / "trace.mcap", truths()))
    }
    assert found["metadata"] == "there are 0 metadata records net.asam.osi.trace, one is expected"
    assert found["channel"].startswith("channel 'ground_truth' has no net.asam.osi.trace.channel.")


def test_publish_times_are_timestamps(tmp_path: Path) -> None:
    messages = truths()
    path = mcap(tmp_path / "trace.mcap", messages, late=7)
    assert any(
        each.message == "message 1 and 19 more: the publish time is not the timestamp"
        for each in check(path)
    )


def test_of_one_rule_no_more_is_reported_than_can_be_read(tmp_path: Path) -> None:
    (message,) = truths(1)
    for number in range(MOST + 5):
        message.moving_object.add().id.value = 100 + number
    path = write(tmp_path / "trace.osi", [message.SerializeToString()])
    found = [each for each in check(path) if each.rule.endswith("object.type_is_known")]
    assert len(found) == MOST + 1 and found[-1].level == "info"


def test_a_fault_that_a_message_has_twice_counts_once(tmp_path: Path) -> None:
    messages = truths(2)
    for message in messages:
        for _ in range(2):  # without ids, so that both have one text
            message.moving_object.add().vehicle_attributes.number_wheels = 0
    path = write(tmp_path / "trace.osi", [each.SerializeToString() for each in messages])
    (found,) = [each for each in check(path) if "number_wheels" in each.message]
    assert found.message.startswith("message 1 and 1 more: ")


def test_a_damaged_trace_is_a_problem(tmp_path: Path) -> None:
    path = tmp_path / "trace.osi"
    path.write_bytes(b"\xff" * 9)
    (problem,) = check(path)
    assert problem.rule == READABLE and "it is truncated, or no OSI trace" in problem.message


def test_the_command_lists_the_rules() -> None:
    listed = CliRunner().invoke(xosc_check.app, ["--rules"]).stdout
    assert all(rule.uid in listed for rule in all_osi_rules())


@pytest.mark.parametrize("form", ["json", "junit", "xqar", "sarif"])
def test_reports_name_the_rules(form: str, tmp_path: Path) -> None:
    path = write(tmp_path / "trace.osi", [each.SerializeToString() for each in truths()])
    answer = CliRunner().invoke(xosc_check.app, [str(path), "--format", form])
    assert answer.exit_code == 1 and "message 1 and 19 more: version is not set" in answer.stdout
