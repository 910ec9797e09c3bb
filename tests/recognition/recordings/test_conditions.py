"""Weather, daylight, surface and speed limit of recordings, from their data or
an `odd.toml`, as columns and tags.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from recognition import recordings as datasets
from recognition.catalogue import pipeline
from recognition.recordings.conditions import OddConditions, daylight
from recognition.recordings.formats import osi as osi_traces
from schemas.common.errors import InvalidFile
from tests.recognition.motorway import write_motorway
from tests.recognition.recordings import test_nuscenes
from tests.recognition.traffic import Car, commonroad, ind_rows, write_highd, write_ind
from xosc.listing.questions import condition
from xosc.listing.tables import read_index

CAR = Car(1, 100.0, 21.0, 30.0, lane=6)


@pytest.mark.parametrize(
    ("stated", "found"),
    [
        ({"month": "9.2017", "startTime": "08:38", "duration": 901.4}, "day"),
        ({"month": "12", "startTime": "12:00", "duration": 900.0}, "day"),
        ({"month": "12", "startTime": "23:10"}, "night"),
        ({"month": "12", "startTime": "08:20", "duration": 900.0}, "unknown"),
        ({"startTime": "12:30", "duration": 900.0}, "day"),
        ({"startTime": "19:00", "duration": 900.0}, "unknown"),
        ({"month": "6", "startTime": "25:00"}, "unknown"),
        ({"month": "6", "startTime": "noon"}, "unknown"),
        ({"month": "6"}, "unknown"),
        ({}, "unknown"),
    ],
)
def test_month_and_hour_give_daylight_where_it_is_sure(
    stated: dict[str, object], found: str, tmp_path: Path
) -> None:
    write_highd(tmp_path, [CAR], **stated)
    (source,) = datasets.open(tmp_path).sources
    assert source.conditions() == OddConditions(daylight=found)


@pytest.mark.parametrize(
    ("latitude", "month", "hour", "found"),
    [(69.6, 12, 12.0, "unknown"), (69.6, 6, 0.5, "day"), (36.0, 12, 9.0, "day"),
        (50.9, 1, 2.0, "night")],
)  # fmt: skip
def test_the_sun_follows_latitude_and_season(
    latitude: float, month: int, hour: float, found: str
) -> None:
    """Tromsø has midnight sun in June, and in December twilight at noon, which ends in between."""
    assert daylight(latitude, 15.0, (month,), hour, hour) == found


def test_an_hour_at_which_the_sun_is_up_all_year_is_day_without_a_month(tmp_path: Path) -> None:
    write_ind(tmp_path, ind_rows(1, 0.0, 0.0, 8.0, 0.0), startTime=13, speedLimit=13.89)
    (source,) = datasets.open(tmp_path).sources
    assert source.conditions() == OddConditions(daylight="day", limit=13.89)


@pytest.mark.parametrize(
    ("environment", "found"),
    [
        ("<weather>heavy_rain</weather><underground>wet</underground><timeOfDay>night</timeOfDay>",
            ("rain", "night", "wet")),
        ("<weather>sunny</weather><underground>ice</underground>", ("clear", "unknown", "icy")),
        ("<weather>locusts</weather>", ("unknown", "unknown", "unknown")),
    ],
)  # fmt: skip
def test_commonroad_states_weather_time_of_day_and_ground(
    environment: str, found: tuple[str, ...], tmp_path: Path
) -> None:
    location = f"<location><environment>{environment}</environment></location>"
    (tmp_path / "one.xml").write_text(commonroad(location, version="2020a"))
    (source,) = datasets.open(tmp_path).sources
    assert source.conditions() == OddConditions(*found)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("Night, after rain, parked cars", OddConditions("rain", "night")),
        ("Knights of a brain trust", OddConditions()),
        (None, OddConditions()),
    ],
)
def test_nuscenes_describes_rain_and_night(
    text: str | None, found: OddConditions, tmp_path: Path
) -> None:
    tables = test_nuscenes.tables()
    if text is not None:
        tables["scene"][0]["description"] = text
    for name, rows in tables.items():
        (tmp_path / f"{name}.json").write_text(json.dumps(rows))
    (source,) = datasets.open(tmp_path).sources
    assert source.odd() == found


def test_osi_has_precipitation_fog_and_the_sun(tmp_path: Path) -> None:
    environment = pytest.importorskip("osi3.osi_environment_pb2")
    told = environment.EnvironmentalConditions
    for message, found in (
        (told(precipitation=told.PRECIPITATION_LIGHT), ("rain", "unknown")),
        (told(precipitation=told.PRECIPITATION_HEAVY, temperature=268.0), ("snow", "unknown")),
        (told(precipitation=told.PRECIPITATION_NONE, fog=told.FOG_DENSE), ("fog", "unknown")),
        (told(precipitation=told.PRECIPITATION_NONE), ("clear", "unknown")),
        (told(sun={"elevation": 0.4}), ("unknown", "day")),
        (told(sun={"elevation": -0.4}), ("unknown", "night")),
        (told(), ("unknown", "unknown")),
    ):
        assert osi_traces.conditions_in(message) == OddConditions(*found)


def test_a_file_beside_recordings_states_what_their_data_do_not(tmp_path: Path) -> None:
    write_highd(tmp_path / "data" / "one", [CAR], name="01", month="12", startTime="12:00")
    write_highd(tmp_path / "data" / "one", [CAR], name="02")
    (tmp_path / "data" / "odd.toml").write_text(
        'weather = "rain"\nsurface = "wet"\n[recordings."one/02"]\nweather = "fog"\nlimit = 30\n'
    )
    first, second = datasets.open(tmp_path).sources
    assert first.conditions() == OddConditions("rain", "day", "wet")
    assert second.conditions() == OddConditions("fog", "unknown", "wet", 30)


@pytest.mark.parametrize(
    ("folder", "text", "day"),
    [
        ("site_2018-05-02", "", "2018-05-02"),
        ("site_2018-05-02", "day = 2019-01-01", "2019-01-01"),
        ("site", 'day = "2019-01-01"', "2019-01-01"),
        ("site_2018-13-02", "", "unknown"),
        ("site_12018-05-021", "", "unknown"),
    ],
)
def test_the_day_is_stated_or_in_a_name(folder: str, text: str, day: str, tmp_path: Path) -> None:
    write_highd(tmp_path / folder, [CAR])
    (tmp_path / folder / "odd.toml").write_text(text)
    (source,) = datasets.open(tmp_path).sources
    assert source.conditions().day == day


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('weather = "wet"', "none of clear, cloudy, rain"),
        ('wheather = "rain"', "weather"),
        ("limit = -3", "no speed of 0 to 100 m/s"),
        ("limit = true", "no speed"),
        ('day = "2020-02-30"', "day: 2020-02-30 is no date as 2018-05-02"),
        ("day = 2020-02-28T12:00:00", "no date"),
        ("day = 3", "no date"),
        ('recordings = "all"', "a table for each recording"),
        ('[recordings.a]\ndaylight = "noon"', "none of day, twilight, night"),
        ("weather", "no TOML"),
    ],
)
def test_a_wrong_file_is_refused_by_key_with_the_choices(
    text: str, message: str, tmp_path: Path
) -> None:
    write_highd(tmp_path, [CAR])
    (tmp_path / "odd.toml").write_text(text)
    (source,) = datasets.open(tmp_path).sources
    with pytest.raises(InvalidFile, match=message):
        source.conditions()


def test_cut_ins_with_a_short_ttc_at_speed_in_rain_are_a_question(tmp_path: Path) -> None:
    write_motorway(tmp_path / "wet", month="9.2017", startTime="12:00")
    (tmp_path / "wet" / "odd.toml").write_text('weather = "rain"')
    pipeline.build([tmp_path / "wet"], tmp_path / "out")
    table = read_index(tmp_path / "out").table

    def asked(speed: str, weather: str) -> list[str]:
        text = (
            f"class = 'highway cut in' and pair_ttc < 60 and ego_speed > {speed} and "
            f"weather = '{weather}'"
        )
        return table.filter(condition(text, table.schema).expression)["openlabel"].to_pylist()

    (file,) = asked("100 km/h", "rain")
    assert not asked("100 m/s", "rain") and not asked("100 km/h", "unknown")
    assert set(table["daylight"].to_pylist()) == {"day"}
    assert set(table["surface"].to_pylist()) == {"unknown"}
    written = json.loads((tmp_path / "out" / file).read_text())["openlabel"]
    types = {one["type"] for one in written["tags"].values()}
    assert {"WeatherRain", "IlluminationDay", "SubjectVehicleSpeed"} <= types
