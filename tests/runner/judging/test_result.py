"""What a result offers: a line, a table, files, a page, a data frame; and
progress on the way to it.
"""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path

import pytest

import runner
from runner.batch.batch import run_batch
from runner.batch.jobs import Job
from runner.batch.outputs.folder import load_run
from runner.view.replay import notebook
from runner.view.replay.player import replay_page, write_replay
from schemas.common.errors import UsageError
from tests.runner.files import scenario


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> runner.RunResult:
    file = scenario(tmp_path_factory.mktemp("run"), name="a & b", stop=12.0)
    return runner.run(file, world="kinematic", sut="none", parameters={"Gap": 30})


def test_it_is_one_line_and_a_table(result: runner.RunResult) -> None:
    assert repr(result) == (
        "<RunResult a & b: failed (collision with Lead at 2.50 s), completed at 12.00 s, sut none>"
    )
    page = result._repr_html_()
    assert (
        "<caption>a &amp; b</caption>" in page
        and "failed: collision with Lead at 2.50 s" in page
        and "Gap = 30" in page
    )


def test_notebooks_show_it_with_its_replay_in_a_sandbox(
    result: runner.RunResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    (frame,) = re.findall(r"<iframe [^>]*></iframe>", result._repr_html_())
    assert 'sandbox="allow-scripts"' in frame
    assert unescape(re.findall(r'srcdoc="([^"]*)"', frame)[0]) == replay_page([result])
    monkeypatch.setattr(notebook, "_LARGEST", 1000)
    assert (
        "<iframe" not in result._repr_html_()
        and "result.replay() writes it" in result._repr_html_()
    )


def test_notebooks_show_a_batch_with_its_failures_and_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = scenario(tmp_path, stop=4.0)
    jobs = [Job(name, file, file, {"Gap": gap}) for name, gap in (("far", "90"), ("near", "12"))]
    list(run_batch(jobs, runner.RunSettings(sut="none", world="kinematic"), out=tmp_path / "out"))
    write_replay([load_run(tmp_path / "out" / "near")], tmp_path / "out" / "near" / "replay.html")
    monkeypatch.chdir(tmp_path)
    batch = notebook.show("out")
    assert repr(batch) == "<BatchView out: 2 runs: 1 failed, 1 passed>"
    page = batch._repr_html_()
    assert page.index('<a href="out/near/replay.html">near</a>') < page.index("<th>far</th>")
    assert "srcdoc=" in page
    assert notebook.show(tmp_path / "out" / "near").verdict.failures  # type: ignore[union-attr]


def test_it_is_saved_as_the_command_saves_it(result: runner.RunResult, tmp_path: Path) -> None:
    for _ in range(2):
        folder = result.save(tmp_path / "runs" / "one")
    assert {path.name for path in folder.iterdir()} == {
        "criticality.parquet", "events.jsonl", "result.json", "trajectories.csv",
        "trajectories.parquet",
    }  # fmt: skip
    loaded = load_run(folder)
    assert loaded.verdict == result.verdict and loaded.trajectories.equals(result.trajectories)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("not of a run")
    with pytest.raises(UsageError, match="is not of a run"):
        result.save(tmp_path / "mine")


def test_it_is_played(
    result: runner.RunResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert result.replay() == Path("a & b.html")
    assert result.replay("page.html").read_bytes() == Path("a & b.html").read_bytes()


def test_it_is_a_data_frame(result: runner.RunResult) -> None:
    pytest.importorskip("pandas")
    frame = result.to_pandas()
    assert len(frame) == result.trajectories.num_rows and set(frame["entity"]) == {"Ego", "Lead"}


def test_progress_is_reported_each_step(tmp_path: Path) -> None:
    times: list[float] = []
    runner.run(scenario(tmp_path, stop=0.2), world="kinematic", progress=times.append)
    assert times == [0.05, 0.1, 0.15, 0.2]
