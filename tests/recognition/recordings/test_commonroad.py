"""CommonRoad scenarios of both versions, as files and in archives."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from recognition import recordings as datasets
from recognition.recordings.formats.commonroad import document
from schemas.common.errors import InvalidFile, Unsupported
from tests.recognition.traffic import (
    RECTANGLE,
    commonroad,
    commonroad_state,
    obstacle,
    read,
    total_rows,
    write_archive,
)
from xodr.formats.commonroad import lanelets
from xodr.formats.lanelet2 import LaneletNeighbour

NORTH = math.pi / 2
LANELET = """<lanelet id="7">
<leftBound><point><x>0</x><y>2</y></point><point><x>9</x><y>2</y></point></leftBound>
<rightBound><point><x>0</x><y>-2</y></point><point><x>9</x><y>-2</y></point></rightBound>
<predecessor ref="5"/><successor ref="8"/><successor ref="9"/><adjacentLeft ref="6" drivingDir="opposite"/>
<laneletType>urban</laneletType></lanelet>"""


def write(folder: Path, *content: str, **head: str) -> Path:
    path = folder / "DEU_Test-1_1_T-1.xml"
    path.write_text(commonroad(*content, **head))
    return path


@pytest.mark.parametrize("version", ["2018b", "2020a"])
def test_states_become_rows_of_the_rear_axle(tmp_path: Path, version: str) -> None:
    recording, report = read(
        write(tmp_path, obstacle(3, 10.0, 20.0, NORTH, 8.0, version=version), version=version)
    )
    track = recording.tracks["3"]
    assert (track.kind, track.category, track.box.length, track.box.width) == (
        "vehicle",
        "car",
        4.0,
        2.0,
    )
    columns = track.columns
    assert (columns["x"][0], columns["y"][0]) == pytest.approx((10.0, 20.0 - 1.2))
    assert columns["y"][-1] == pytest.approx(20.0 + 0.9 * 8.0 - 1.2)
    assert columns["time"] == pytest.approx(np.arange(10) * 0.1)
    assert (columns["raw_speed"] == 8.0).all()
    assert columns["speed"] == pytest.approx(8.0)
    assert recording.timestep == 0.1
    assert (report.rows, report.tracks, report.excluded) == (10, 1, 0)


def test_accelerations_are_those_given_or_derived(tmp_path: Path) -> None:
    given = obstacle(1, 0.0, 0.0, 0.0, 8.0, more="<acceleration><exact>1.5</exact></acceleration>")
    recording, report = read(write(tmp_path, given, obstacle(2, 0.0, 9.0, 0.0, 8.0)))
    assert recording.tracks["1"].columns["raw_acceleration"] == pytest.approx(1.5)
    assert recording.tracks["2"].columns["raw_acceleration"] == pytest.approx(0.0)
    assert report.remarks == ["accelerations that are not given are derived from the speeds"]


@pytest.mark.parametrize(
    ("shape", "size", "centre"),
    [
        (RECTANGLE, (4.0, 2.0), (0.0, 0.0)),
        ("<circle><radius>0.4</radius></circle>", (0.8, 0.8), (0.0, 0.0)),
        (
            "<rectangle><length>4</length><width>2</width><center><x>1</x><y>0</y></center></rectangle>",
            (4.0, 2.0),
            (1.0, 0.0),
        ),
        (
            f"<rectangle><length>4</length><width>2</width><orientation>{NORTH}</orientation></rectangle>",
            (2.0, 4.0),
            (0.0, 0.0),
        ),
        (
            "<polygon>"
            + "".join(
                f"<point><x>{x}</x><y>{y}</y></point>" for x, y in ((0, 0), (3, 0), (3, 1), (0, 2))
            )
            + "</polygon>",
            (3.0, 2.0),
            (1.5, 1.0),
        ),
        (
            f"{RECTANGLE}<circle><center><x>3</x><y>0</y></center><radius>1</radius></circle>",
            (6.0, 2.0),
            (1.0, 0.0),
        ),
    ],
)
def test_box_bounds_the_shapes_about_their_origin(
    tmp_path: Path, shape: str, size: tuple, centre: tuple
) -> None:
    track = read(write(tmp_path, obstacle(1, 0.0, 0.0, NORTH, 5.0, shape=shape)))[0].tracks["1"]
    assert (track.box.length, track.box.width) == pytest.approx(size)
    columns = track.columns
    ahead, left = centre
    assert columns["x"][0] == pytest.approx(-left, abs=1e-9)
    assert columns["y"][0] + track.box.x == pytest.approx(ahead)


@pytest.mark.parametrize(
    ("type_", "kind", "category"),
    [
        ("truck", "vehicle", "truck"), ("bicycle", "vehicle", "bicycle"),
        ("pedestrian", "pedestrian", "pedestrian"),
        ("parkedVehicle", "vehicle", "car"), ("constructionZone", "miscellaneous", "obstacle"),
    ],
)  # fmt: skip
def test_types_become_categories(tmp_path: Path, type_: str, kind: str, category: str) -> None:
    track = read(write(tmp_path, obstacle(1, 0.0, 0.0, 0.0, 1.0, kind=type_)))[0].tracks["1"]
    assert (track.kind, track.category) == (kind, category)


@pytest.mark.parametrize(
    "standing",
    [
        f'<obstacle id="8"><role>static</role><type>car</type><shape>{RECTANGLE}</shape>',
        f'<staticObstacle id="8"><type>car</type><shape>{RECTANGLE}</shape>',
    ],
)
def test_static_obstacle_stands_from_its_first_moment_to_the_end(
    tmp_path: Path, standing: str
) -> None:
    end = standing[1:].split(" ")[0]
    parked = f"{standing}{commonroad_state('initialState', 2, 5.0, 5.0, 0.0, 0.0)}</{end}>"
    recording, _ = read(write(tmp_path, obstacle(1, 0.0, 0.0, 0.0, 5.0), parked, version="2020a"))
    columns = recording.tracks["8"].columns
    assert columns["time"] == pytest.approx(np.arange(2, 10) * 0.1)
    assert (columns["x"] == columns["x"][0]).all()


def test_states_missing_in_between_are_a_gap(tmp_path: Path) -> None:
    text = obstacle(1, 0.0, 0.0, 0.0, 5.0)
    text = text.replace(commonroad_state("state", 4, 2.0, 0.0, 0.0, 5.0), "")
    _, report = read(write(tmp_path, text))
    assert report.gaps == [datasets.Gap("1", pytest.approx(0.3), pytest.approx(0.5), 1)]


@pytest.mark.parametrize(
    ("left_out", "rows", "reason"),
    [
        (
            (
                "<phantomObstacle "
                'id="5"><occupancySet><occupancy/><occupancy/></occupancySet></phantomObstacle>'
            ),
            2,
            "role 'phantom'",
        ),
        (
            '<environmentObstacle id="6"><type>building</type></environmentObstacle>',
            0,
            "role 'environment'",
        ),
        (
            (
                "<dynamicObstacle "
                'id="7"><initialState/><occupancySet><occupancy/></occupancySet></dynamicObstacle>'
            ),
            2,
            "possible places",
        ),
    ],
)
def test_obstacles_without_a_way_are_excluded_and_reported(
    tmp_path: Path, left_out: str, rows: int, reason: str
) -> None:
    recording, report = read(write(tmp_path, obstacle(1, 0.0, 0.0, 0.0, 5.0), left_out))
    (exclusion,) = report.exclusions
    assert exclusion.rows == rows
    assert reason in exclusion.reason
    assert list(recording.tracks) == ["1"]


def test_scenario_without_obstacles_is_an_empty_recording_that_says_so(tmp_path: Path) -> None:
    recording, report = read(write(tmp_path, LANELET))
    assert not recording.tracks
    assert report.remarks == ["there is no obstacle with a way"]


def test_lanelets_have_bounds_links_and_types(tmp_path: Path) -> None:
    (source,) = datasets.open(write(tmp_path, LANELET)).sources
    assert source.map == source.path
    (lanelet,) = lanelets(document(source.path))
    assert lanelet.left.tolist() == [[0.0, 2.0], [9.0, 2.0]]
    assert (lanelet.id, lanelet.predecessors, lanelet.successors) == ("7", ("5",), ("8", "9"))
    assert (lanelet.beside_left, lanelet.beside_right) == (LaneletNeighbour("6", False), None)
    assert lanelet.types == ("urban",)
    assert lanelet.limit == math.inf


@pytest.mark.parametrize(("value", "limit"), [("13.4", 13.4), ("36kmh", 10.0), ("fast", math.inf)])
def test_traffic_signs_limit_the_speed(tmp_path: Path, value: str, limit: float) -> None:
    sign = f"""<trafficSign id="3"><trafficSignElement><trafficSignID>R2-1</trafficSignID>
<additionalValue>{value}</additionalValue></trafficSignElement></trafficSign>"""
    refers = LANELET.replace("<laneletType>", '<trafficSignRef ref="3"/><laneletType>')
    (lanelet,) = lanelets(document(write(tmp_path, refers, sign, version="2020a")))
    assert lanelet.limit == pytest.approx(limit)


ALONE = re.sub("<(?:predecessor|successor|adjacentLeft) [^>]*/>", "", LANELET)


def kinds(folder: Path, *content: str) -> set[str]:
    """Types of the roads that a scenario's lanelets become."""
    (source,) = datasets.open(write(folder, *content, version="2020a")).sources
    assert source.road is not None
    return set(
        re.findall(
            r'<type s="[^"]*" type="(\w+)"', source.road(source.load(), folder).path.read_text()
        )
    ) - {"unknown"}


@pytest.mark.parametrize(
    ("tag", "type_", "found"),
    [
        ("interstate", "urban", {"motorway"}),
        ("highway", "urban", {"motorway"}),
        ("urban", "unknown", {"town"}),
        ("comfort", "unknown", set()),
        ("comfort", "urban", {"town"}),
        ("comfort", "mainCarriageWay", {"motorway"}),
    ],
)
def test_tags_tell_what_roads_are_and_types_where_tags_are_silent(
    tmp_path: Path, tag: str, type_: str, found: set[str]
) -> None:
    assert (
        kinds(tmp_path, f"<scenarioTags><{tag}/></scenarioTags>", ALONE.replace("urban", type_))
        == found
    )


def test_one_urban_lanelet_makes_a_town_of_those_that_say_nothing(tmp_path: Path) -> None:
    other = (
        ALONE.replace('id="7"', 'id="8"')
        .replace("<y>-2", "<y>18")
        .replace("<y>2<", "<y>22<")
        .replace("urban", "unknown")
    )
    assert kinds(tmp_path, ALONE, other) == {"town"}


def test_a_speed_limit_tells_more_than_the_type(tmp_path: Path) -> None:
    sign = """<trafficSign id="3"><trafficSignElement><trafficSignID>274</trafficSignID>
<additionalValue>33.3</additionalValue></trafficSignElement></trafficSign>"""
    assert (
        kinds(
            tmp_path, ALONE.replace("<laneletType>", '<trafficSignRef ref="3"/><laneletType>'), sign
        )
        == set()
    )


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        (
            "<point><x>9</x><y>2</y></point></left",
            "</left",
            r"xml:4: leftBound: a bound has two points or more",
        ),
        (
            "</leftBound>",
            "<point><x>9</x><y>3</y></point></leftBound>",
            "xml:3: lanelet: the left bound has 3 points, the right",
        ),
        ("<x>9</x><y>2</y>", "<x>far</x><y>2</y>", "xml:4: x: 'far' is no measured value"),
    ],
)
def test_bad_lanelet_is_refused_with_its_line(
    tmp_path: Path, old: str, new: str, complaint: str
) -> None:
    (source,) = datasets.open(write(tmp_path, LANELET.replace(old, new))).sources
    with pytest.raises(InvalidFile, match=complaint):
        lanelets(document(source.path))


# archives -----------------------------------------------------------------------------------


@pytest.mark.parametrize("ending", [".tar", ".tar.gz", ".tar.bz2", ".tar.xz"])
def test_archive_holds_a_source_for_each_scenario(tmp_path: Path, ending: str) -> None:
    one, two = (commonroad(obstacle(k, 0.0, 0.0, 0.0, 5.0)) for k in (1, 2))
    names = ["set/USA_Lanker-1_1_T-1.xml", "set/USA_Lanker-1_2_T-1.xml"]
    archive = write_archive(
        tmp_path / f"pack{ending}", {names[0]: one, "README.txt": "", names[1]: two}
    )
    sources = datasets.open(archive).sources
    assert [source.name for source in sources] == [name.removesuffix(".xml") for name in names]
    assert {source.site for source in sources} == {"USA_Lanker-1"}
    assert [list(source.load().tracks) for source in reversed(sources)] == [["2"], ["1"]]


@pytest.mark.parametrize("ending", [".tar", ".tar.gz", ".tar.xz"])
def test_archive_cut_short_is_refused_and_loses_nothing_silently(
    tmp_path: Path, ending: str
) -> None:
    text = commonroad(obstacle(1, 0.0, 0.0, 0.0, 5.0))
    path = write_archive(tmp_path / f"a{ending}", {f"A_B-1_{k}_T-1.xml": text for k in range(3)})
    data = path.read_bytes()
    read_whole = 0
    for end in range(0, len(data), max(1, len(data) // 40)):
        path.write_bytes(data[:end])
        sources = datasets.open(path).sources
        try:
            rows = [total_rows(source.load()) for source in sources]
        except InvalidFile as error:
            assert error.path == str(path)
        else:
            read_whole += 1
            assert rows == [10, 10, 10]
    assert read_whole < 20


def test_damaged_header_is_not_taken_for_the_end_of_the_archive(tmp_path: Path) -> None:
    path = write_archive(tmp_path / "a.tar", {f"A_B-1_{k}_T-1.xml": commonroad() for k in range(3)})
    data = bytearray(path.read_bytes())
    data[1024] ^= 0xFF  # the second header: each is a block of 512 bytes, as is each content
    path.write_bytes(data)
    (source,) = datasets.open(path).sources
    with pytest.raises(InvalidFile, match=r"a\.tar: this is no tar archive, or a damaged one"):
        source.load()


def test_fault_in_an_archive_names_the_file_in_it_and_the_line(tmp_path: Path) -> None:
    path = write_archive(
        tmp_path / "a.tar.xz", {"set/bad.xml": commonroad(obstacle(1, 0, 0, 0, 5, kind="ufo"))}
    )
    (source,) = datasets.open(path).sources
    with pytest.raises(
        InvalidFile, match=r"a.tar.xz/set/bad.xml:3: obstacle: 'ufo' is none of the types"
    ):
        source.load()


# bad files ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "error", "complaint"),
    [
        (
            "<exact>5.0</exact>",
            "<exact>nan</exact>",
            InvalidFile,
            "3: exact: 'nan' is no measured value",
        ),
        ("<x>0.0</x>", "<x>1e300</x>", InvalidFile, "3: x: '1e300' is no measured value"),
        ("<x>0.0</x>", "", InvalidFile, "3: point: there is no x"),
        ("<time><exact>0</exact></time>", "", InvalidFile, "3: initialState: there is no time"),
        (
            "<time><exact>3</exact>",
            "<time><exact>2</exact>",
            InvalidFile,
            "3: state: the time 2 comes after 2",
        ),
        (
            "<time><exact>3</exact>",
            "<time><exact>2.5</exact>",
            InvalidFile,
            "3: state: the time 2.5 is not a whole number",
        ),
        ("<type>car</type>", "", InvalidFile, "3: obstacle: there is no type"),
        ("<length>4.0", "<length>0", InvalidFile, "3: length: 0 m is no size"),
        (RECTANGLE, "", InvalidFile, "3: obstacle: the shape is empty"),
        (
            "<time><exact>9</exact>",
            "<time><exact>900000000</exact>",
            InvalidFile,
            "3: state: the time 9e.08 is not a whole number",
        ),
        ('id="1"', "", InvalidFile, "3: obstacle: there is no id"),
        ('id="2"', 'id="1"', InvalidFile, "4: obstacle: there is another obstacle 1"),
        (
            "<exact>5.0</exact>",
            "<intervalStart>4</intervalStart>",
            Unsupported,
            "3: velocity: a value given as an interval",
        ),
        (
            "<point><x>0.0</x><y>0.0</y></point>",
            RECTANGLE,
            Unsupported,
            "3: position: an uncertain position",
        ),
        (RECTANGLE, "<star/>", Unsupported, "3: star: this shape"),
        (
            'timeStepSize="0.1"',
            'timeStepSize="0"',
            InvalidFile,
            "2: commonRoad: timeStepSize 0 s is no time step",
        ),
        (
            'timeStepSize="0.1"',
            'timeStepSize="1e-320"',
            InvalidFile,
            "time: frames are .* s apart, at least 0.0001 s",
        ),
        ('timeStepSize="0.1"', "", InvalidFile, "2: commonRoad: '' is no measured value"),
        ("2018b", "2017a", Unsupported, "2: commonRoad: version '2017a' is none of 2018b, 2020a"),
        ("</commonRoad>", "", InvalidFile, "not well-formed XML"),
        (
            '<?xml version="1.0"?>',
            '<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]>',
            InvalidFile,
            "DOCTYPE. is refused",
        ),
    ],
)
def test_bad_scenario_is_refused_with_line_and_element(
    tmp_path: Path, old: str, new: str, error: type, complaint: str
) -> None:
    path = write(tmp_path, obstacle(1, 0.0, 0.0, 0.0, 5.0), obstacle(2, 0.0, 9.0, 0.0, 5.0))
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(error, match=rf"DEU_Test-1_1_T-1\.xml:.*{complaint}"):
        read(path)


def test_a_trajectory_may_begin_with_the_initial_state(tmp_path: Path) -> None:
    path = write(tmp_path, obstacle(1, 0.0, 0.0, 0.0, 5.0))
    expected, text = read(path)[0].tracks["1"].columns, path.read_text()
    initial = (
        text[text.index("<initialState>") : text.index("</initialState>")].replace(
            "<initialState>", "<state>"
        )
        + "</state>"
    )
    path.write_text(text.replace("<trajectory>", f"<trajectory>{initial}", 1))
    found = read(path)[0].tracks["1"].columns
    assert all(
        np.array_equal(found[name], expected[name], equal_nan=True)
        for name in ("time", "x", "y", "h", "speed")
    )
    path.write_text(
        text.replace("<trajectory>", f"<trajectory>{initial.replace('<x>0.0', '<x>1.0')}", 1)
    )
    with pytest.raises(InvalidFile, match="the time 0 comes after 0"):
        read(path)


def test_file_that_only_mentions_commonroad_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.xml"
    path.write_text("<list><commonRoad/></list>")
    with pytest.raises(
        InvalidFile, match=r"a\.xml:1: list: the root element of a scenario is commonRoad"
    ):
        read(path)


# real recordings ----------------------------------------------------------------------------


def test_ngsim_scenarios_of_the_archive_read(recordings: Path) -> None:
    sources = datasets.open(recordings / "ngsim" / "USA_ngsim_commonroad_xml.tar.xz").sources
    assert len(sources) == 148
    assert {source.site.split("-")[0] for source in sources} == {
        "USA_US101",
        "USA_Lanker",
        "USA_Peach",
    }
    for source in sources[:3]:
        recording = source.load()
        assert source.report is not None
        assert source.report.rows == total_rows(recording) > 100
        assert lanelets(document(source.path, f"{source.name}.xml"))
