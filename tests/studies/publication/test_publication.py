"""The publication's tables: commands that exist, runs that go on, and a page
that says what the result files say.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
import typer

from generation.space.logical.library import SCENARIOS
from generation.space.space import Space
from schemas.common.errors import InvalidFile
from studies.publication import __main__ as command
from studies.publication import page, pictures, results
from studies.publication.stages import SCALES, Stage, stages
from tests.studies.publication.extracts import write_highd, write_interaction

SCALE = "smallest"
RESULTS = results.RESULTS


@pytest.fixture
def call(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., int]:
    def calling(*arguments: str) -> int:
        paths = ("--out", tmp_path / "work", "--results", tmp_path / "results")
        monkeypatch.setattr(sys, "argv", ["publication", *map(str, (*arguments, *paths))])
        with pytest.raises(SystemExit) as ended:
            command.main()
        return int(ended.value.code or 0)

    return calling


@pytest.mark.parametrize("scale", SCALES)
def test_each_stage_is_a_command_with_options_that_exist(scale: str, tmp_path: Path) -> None:
    for stage in stages(SCALES[scale], tmp_path):
        module, name, *arguments = stage.command
        app = import_module(module if "xosc" in module else f"{module}.__main__").app
        found = cast(Any, typer.main.get_command(app)).commands[name]
        if "recognition" in module and name == "protocol":
            arguments[0] = str(tmp_path)  # which the stage before it makes
        context = found.make_context(name, arguments)
        assert context.params["out"] is not None


def test_recordings_of_ones_own_take_the_place_of_sumos(tmp_path: Path) -> None:
    units, published, *others = stages(SCALES["full"], tmp_path, tmp_path / "highd")
    assert "recordings" not in [stage.name for stage in others]
    assert str(tmp_path / "highd") in units.command and str(tmp_path / "highd") in published.command
    for stage in others[1:]:
        place = stage.command.index("--recorded")
        assert stage.command[place + 1] == str(tmp_path / "units.parquet") == units.command[-1]


@pytest.mark.slow
def test_extracts_of_highd_and_interaction_give_tables_of_their_own(
    call: Callable[..., int], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    write_highd(tmp_path / "own" / "highD" / "data", range(1, 7))
    write_interaction(tmp_path / "own" / "INTERACTION", range(6))
    few = SCALES[SCALE]._replace(rows=("trfe", "random"))
    monkeypatch.setitem(SCALES, SCALE, few)
    searched = "cut_in_narrow_road", "diverging_highway", "merging_highway", "congestion_highway"
    made, shown = ("units", "published", *searched), tmp_path / "page.md"
    chosen = [part for name in made for part in ("--only", name)]
    own = ("--recordings", str(tmp_path / "own"))
    assert call("--smallest", *own, *chosen, "--page", str(shown)) == 0

    def rows(stage: str, name: str) -> list[list[str]]:
        return results.read_table(tmp_path / "results" / SCALE / stage / f"{name}.csv")[1:]

    motorway, junction = (1, 2, 3, 4, 5, 6), (14, 15, 16)
    assert [int(row[0]) for row in rows("published", "data")] == [*motorway, *junction]
    ours, least = (float(row[1]) for row in rows("published", "open-set"))
    assert ours > least
    # Manoeuvres of these recordings in the place of the shipped ones: those inside the limits.
    for stage, least, most in zip(searched, (24, 20, 40, 12), (48, 24, 60, 24), strict=True):
        ((manoeuvres, *_),) = rows(stage, "reconstruction")
        assert least <= int(manoeuvres) <= most, stage
    text = shown.read_text(encoding="utf-8")
    assert "Our rows are of the recordings that the commands below name" in text
    assert "SUMO's traffic" not in text


def test_a_stage_is_run_again_only_where_its_command_is_another(
    call: Callable[..., int],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    stage, out = Stage("recordings", ("platform",)), str(tmp_path / "page.md")
    monkeypatch.setattr(command, "stages", lambda *_: [stage])
    assert call("--smallest", "--page", out) == 0
    assert "recordings: " in capfd.readouterr().out
    assert call("--smallest", "--page", out) == 0
    assert "recordings: " not in capfd.readouterr().out
    stage = Stage("recordings", ("platform", "--terse"))
    assert call("--smallest", "--page", out) == 0
    assert "recordings: " in capfd.readouterr().out
    assert "`python -m platform --terse`" in (tmp_path / "page.md").read_text(encoding="utf-8")


def test_stages_that_fail_are_named_once_the_others_are_made(
    call: Callable[..., int],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    missing = ("no_such_module_anywhere",)
    made = [
        Stage("published", missing),
        Stage("recordings", ("platform",)),
        Stage("shipped", missing),
    ]
    monkeypatch.setattr(command, "stages", lambda *_: made)
    shown = tmp_path / "page.md"
    assert call("--smallest", "--page", str(shown)) == 5
    assert (
        "the stage published ended with exit code 1; the stage shipped ended with exit code 1"
        in capfd.readouterr().err
    )
    assert "`python -m platform`" in shown.read_text(encoding="utf-8")


def test_two_scales_at_once_are_refused(
    call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("--smallest", "--middle") == 2
    assert "--smallest and --middle are two scales" in capsys.readouterr().err


def test_an_unknown_stage_is_named(
    call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("--smallest", "--only", "shiped") == 2
    assert "there is no stage 'shiped'; stages: recordings, published" in capsys.readouterr().err


def table(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def test_rows_of_ours_stand_beside_the_published_ones(tmp_path: Path) -> None:
    for stage, f1 in (("published", "0.500 ± 0.010"), ("shipped", "0.800")):
        table(
            tmp_path / SCALE / stage / "open-set.csv",
            ",macro-F1,(K+1) "
            f"accuracy,AUROC,OSCR,p\n**TRFE**,{f1},0,0.9,0.7,–\nCAC,0.4,0,0.8,0.6,0.03\n",
        )
    text = page.text(tmp_path)
    assert "| TRFE | 0.906 | 0.500 ± 0.010 | 0.9 | 0.7 | 0.800 | 0.9 | 0.7 |" in text
    assert "| CEVT (reading B) | 0.875 | – | – | – | – | – | – |" in text
    assert "| CAC | – | 0.4 |" in text
    assert "### Table 4: clustering of new classes\n\nNot made with these settings." in text


def test_full_rows_are_shown_before_the_smallest_and_say_their_seeds(tmp_path: Path) -> None:
    for scale, seeds in (("smallest", 1), ("full", 2)):
        for name in ("open-set", "chain") if scale == "smallest" else ("open-set",):
            table(
                tmp_path / scale / "shipped" / f"{name}.csv",
                ",macro-F1,AUROC,OSCR,ACC_cluster,macro-F1 "
                f"after,seeds,p\n**TRFE**,{seeds},,,,,{seeds},\n",
            )
    text = page.text(tmp_path)
    assert "### Table 3: recognition of known and unknown classes\n" in text
    assert "| TRFE | 0.906 | 2 |  |  | 2 |" in text
    assert "### five rounds on the model's own discoveries, smallest settings\n" in text


def test_settings_of_another_scale_have_a_table_of_their_own(tmp_path: Path) -> None:
    for scale, stage in (("full", "shipped"), ("smallest", "shipped"), ("smallest", "published")):
        table(
            tmp_path / scale / stage / "open-world.csv",
            f",ACC_cluster,macro-F1 after\n**TRFE**,{scale} {stage},0.5\n",
        )
    text = page.text(tmp_path)
    shipped, published = text.split("### Figure 3: parts left out, smallest settings\n")
    assert "full shipped" in shipped and "full shipped" not in published
    assert "smallest published" in published
    assert "smallest shipped" not in text


OPEN_SET = ",macro-F1,AUROC,OSCR,seeds,p\n**TRFE**,{},0.9,0.8,{},–\nCAC,{},0.8,0.7,{},{}\n"


def test_five_seeds_of_a_smaller_encoder_stand_below_one_of_the_published(tmp_path: Path) -> None:
    for scale, ours, seeds in (("full", "0.361", 1), ("middle", "0.500", 5)):
        table(
            tmp_path / scale / "published" / "open-set.csv",
            OPEN_SET.format(ours, seeds, "0.4", seeds, "–"),
        )
    text = page.text(tmp_path)
    full, middle = text.split("of known and unknown classes, middle settings\n")
    assert "| TRFE | 0.906 | 0.361 | 0.9 | 0.8 | 1 |" in full
    assert "| TRFE | 0.906 | 0.500 | 0.9 | 0.8 | 5 |" in middle


def test_geometries_stand_in_one_table_for_each_budget(tmp_path: Path) -> None:
    for scale, stage in (
        ("full", "cut_in_narrow_road"),
        ("middle", "cut_in_narrow_road"),
        ("middle", "merging_highway"),
        ("smallest", "merging_highway"),
        ("smallest", "diverging_highway"),
    ):
        table(tmp_path / scale / stage / "generated.csv", f",CR,seeds\nMCSG,{scale} {stage},5\n")
    text = page.text(tmp_path)
    full, rest = text.split("### Figure 8: searches of 300 runs, middle settings\n")
    middle, smallest = rest.split("### Figure 8: searches of 40 runs, smallest settings\n")
    assert "### Figure 8: searches of 3000 runs\n" in full
    for name in ("cut in narrow road", "merging highway"):
        assert f"| {name} | MCSG | middle {name.replace(' ', '_')} | 5 |" in middle
    assert "| diverging highway | MCSG | smallest diverging_highway | 5 |" in smallest
    assert "smallest merging" not in smallest


def test_what_a_part_costs_is_read_from_the_rows_with_most_seeds(tmp_path: Path) -> None:
    wanted = "shipped|open-set|macro-F1|TRFE|CAC"
    assert page._measured(tmp_path, wanted) == "macro-F1: not made yet"
    for scale, ours, seeds in (("full", "0.8", 2), ("middle", "0.7", 5)):
        table(
            tmp_path / scale / "shipped" / "open-set.csv",
            OPEN_SET.format(ours, seeds, "0.6", seeds, "0.03"),
        )
    assert page._measured(tmp_path, wanted) == (
        "macro-F1 *TRFE* 0.7, *CAC* 0.6 (p 0.03) (as shipped, 5 seeds, middle settings)"
    )
    assert page._measured(tmp_path, f"{wanted} & shipped|open-set|AUROC|TRFE").endswith(
        "; AUROC *TRFE* 0.9 (as shipped, 5 seeds, middle settings)"
    )


def test_the_only_row_of_a_table_needs_no_name(tmp_path: Path) -> None:
    table(tmp_path / SCALE / "cut_in_highway" / "reconstruction.csv", "manoeuvres,RMSE_t\n16,0.2\n")
    found = page._measured(tmp_path, "cut_in_highway|reconstruction|RMSE_t")
    assert found == "RMSE_t 0.2 (16 manoeuvres, smallest settings)"


def test_rows_above_ours_are_listed_and_those_of_one_small_seed_are_not(tmp_path: Path) -> None:
    for scale in ("middle", "smallest"):
        table(
            tmp_path / scale / "shipped" / "open-set.csv",
            OPEN_SET.format("0.700 ± 0.010", 5, "0.710 ± 0.020", 4, "0.03"),
        )
    text = page.text(tmp_path)
    assert text.count("macro-F1 | 0.700 ± 0.010 | CAC | 0.710 ± 0.020 | 4 | 0.03 |") == 1
    assert "\nShown to be better: CAC.\n" in text


@pytest.mark.parametrize(
    ("title", "p"), [("CAC", "0.06"), ("CAC", "–"), ('"means, given K"', "0.01")]
)
def test_rows_that_are_told_the_count_or_are_not_certain_are_not_shown_to_be_better(
    tmp_path: Path, title: str, p: str
) -> None:
    header = ",ACC_cluster,seeds,p"
    path = tmp_path / "middle" / "shipped" / "clustering.csv"
    table(path, f"{header}\n**TRFE**,0.7,5,–\n{title},0.8,5,{p}\n")
    assert "\nNo other row is shown to be better: " in page.text(tmp_path)


def test_p_stands_beside_the_figure_that_it_compares(tmp_path: Path) -> None:
    header = ",ACC_cluster,macro-F1 after,seeds,p"
    path = tmp_path / "middle" / "shipped" / "chain.csv"
    table(path, f"{header}\n**TRFE**,0.7,0.5,5,–\nagain,0.8,0.6,5,0.04\n")
    for figure, shown in (("ACC_cluster", False), ("macro-F1 after", True)):
        found = page._measured(tmp_path, f"shipped|chain|{figure}|TRFE|again")
        assert ("(p 0.04)" in found) == shown


def test_each_part_of_the_method_is_measured_but_the_simulator() -> None:
    header, *rows = results.read_table(page.HERE / "components.csv")
    assert {len(row) for row in rows} == {len(header)}  # a comma of a text moves all behind it
    assert [row[0] for row in rows if not row[-1]] == ["3.5 simulator"]
    assert "not made yet" not in page.text(RESULTS)


def test_a_damaged_journal_is_named(tmp_path: Path) -> None:
    table(tmp_path / SCALE / results.JOURNAL, "stage,command\na,b\n")
    with pytest.raises(InvalidFile, match="no journal of stages"):
        page.text(tmp_path)


def test_the_page_says_what_the_result_files_say() -> None:
    assert page.PAGE.read_text(encoding="utf-8") == page.text(RESULTS), (
        "python -m studies.publication --page-only"
    )


@pytest.mark.parametrize("scale", SCALES)
def test_each_row_of_results_comes_from_a_command_that_is_still_there(scale: str) -> None:
    work = Path("WORK")
    now = {one.name: results.written(one, work) for one in stages(SCALES[scale], work)}
    journal = results.read_journal(RESULTS / scale)
    made = {path.parent.name for path in (RESULTS / scale).glob("*/*.csv")}
    assert made <= journal.keys() <= now.keys()
    assert {name: entry.command for name, entry in journal.items()} == {
        name: now[name] for name in journal
    }


def test_pictures_are_those_of_the_result_files_and_small(tmp_path: Path) -> None:
    find = page.finding(RESULTS)
    folder = page.PAGE.parent / pictures.FOLDER
    named = re.findall(r"!\[.*?\]\((.*?)\)", page.PAGE.read_text(encoding="utf-8"))
    shown = [picture for picture in pictures.PICTURES.values() if picture.possible(find)]
    assert named == [f"{pictures.FOLDER}/{picture.file}" for picture in shown]
    assert {path.name for path in folder.iterdir()} == {picture.file for picture in shown}
    for picture in shown:
        assert (folder / picture.file).stat().st_size < 100_000
        if picture.file.endswith(".svg"):
            assert (folder / picture.file).read_bytes() == picture.draw(find), (
                "python -m studies.publication --page-only"
            )


def test_points_of_a_study_become_motions_and_projections(tmp_path: Path) -> None:
    names = (
        "A_Gap_m",
        "A_Speed_mps",
        "A_Before_s",
        "A_Way_m",
        "A_Time_s",
        "A_After_mps",
        "A_Rest_s",
    )
    rows = "\n".join(
        f"{kind},,{20 + number},25,1,3.5,4,26,2"
        for number, kind in enumerate(("recorded", "generated", "collision", "least clearance"))
    )
    path = tmp_path / "cut_in_highway" / "points.csv"
    table(path, f"kind,method,{','.join(names)}\n{rows}\n")

    def find(stage: str, name: str) -> Path | None:
        return path if (stage, name) == ("cut_in_highway", "points") else None

    written = pictures.write(find, tmp_path / "drawn")
    assert [path.name for path in written] == ["figure-5.png", "figure-6.png"]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in written)


def test_a_case_is_drawn_at_its_contact(tmp_path: Path) -> None:
    space = Space.of(SCENARIOS / "merging_highway.xosc")
    values = space.values(space.draw(1, np.random.default_rng(0))[0])
    path = tmp_path / "points.csv"
    row = ",".join(str(values[name]) for name in space.names)
    table(path, f"kind,method,{','.join(space.names)}\nleast clearance,,{row}\n")
    drawn = pictures.PICTURES["8 highways"].draw(
        lambda stage, name: path if (stage, name) == ("merging_highway", "points") else None
    )
    assert drawn.startswith(b"\x89PNG")


def test_the_page_says_what_its_tables_rest_on(tmp_path: Path) -> None:
    header = ",macro-F1,AUROC,OSCR,seeds,p"
    for seeds in (2, 3):
        table(
            tmp_path / "full" / "shipped" / "open-set.csv",
            f"{header}\n**TRFE**,0.8,0.9,0.7,{seeds},–\nCAC,0.4,0.8,0.6,3,0.03\n",
        )
        table(tmp_path / "full" / "shipped" / "data.csv", "id,class,test\n1,a,20\n2,b,30\n")
        text = page.text(tmp_path)
        shown = "3" if seeds == 3 else "2 to 3"
        assert (
            f"| Table 3: shipped | {shown} | 50 test windows of 2 classes in five rounds |" in text
        )
    table(tmp_path / SCALE / "cut_in_highway" / "generated.csv", ",R_risk\n**MCSG** †,0.5\n")
    assert "| Table 5 and figure 7: cut in highway, smallest settings | 1 | 40 runs" in page.text(
        tmp_path
    )
