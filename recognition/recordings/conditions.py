"""Conditions of the operational design domain in which a recording was made: weather, daylight,
surface, speed limit, day.

Formats state them as far as their data do; an `odd.toml` beside a recording, or in one of the two
folders above, states more::

    weather = "rain"               # clear, cloudy, rain, snow, hail, fog
    daylight = "night"             # day, twilight, night
    surface = "wet"                # dry, wet, standing water, flooded, snow, icy, contaminated
    limit = 13.9                   # m/s, where the map has none
    day = 2018-05-02               # without it that in the name of file or folder, if any
    [recordings."01"]              # by name, before the others
    weather = "clear"

Terms: ASAM OpenLABEL 1.0.0 and BSI PAS 1883, 5.2.3.7 (surface), 5.3.1 to 5.3.3 (weather,
particulates, illumination).
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from datetime import date
from pathlib import Path
from typing import Any, NamedTuple

from recognition.recordings.table import column_names, read_table
from schemas.common.errors import InvalidFile, nearest
from schemas.common.storage import read_bytes

UNKNOWN = "unknown"
"""Value where nothing is stated"""
WEATHER = {
    "clear": "",
    "cloudy": "IlluminationCloudiness",
    "rain": "WeatherRain",
    "snow": "WeatherSnow",
    "hail": "",
    "fog": "ParticulatesWater",
}
DAYLIGHT = {"day": "IlluminationDay", "twilight": "LowLightAmbient", "night": "LowLightNight"}
SURFACE = {
    "dry": "",
    "wet": "SurfaceConditionWet",
    "standing water": "SurfaceConditionStandingWater",
    "flooded": "SurfaceConditionFlooded",
    "snow": "SurfaceConditionSnow",
    "icy": "SurfaceConditionIcy",
    "contaminated": "SurfaceConditionContamination",
}
"""Values, and classes of OpenLABEL's ontology; empty where it has none"""
_CLASSES = {"weather": WEATHER, "daylight": DAYLIGHT, "surface": SURFACE}
_FILE, _LIMIT, _DAY, _RECORDINGS = "odd.toml", "limit", "day", "recordings"
_DATE = re.compile(r"(?<!\d)(\d{4}-\d{2}-\d{2})(?!\d)")
_LEVELS = 3
"""Number of folders, that of the recording first, that are searched for the file"""
_FASTEST = 100.0
"""Greatest speed limit, m/s"""


class OddConditions(NamedTuple):
    """Conditions of a recording; `UNKNOWN` where nothing is stated.

    Attributes:
        weather, daylight, surface: keys of `WEATHER`, `DAYLIGHT`, `SURFACE`.
        limit: speed limit where the map has none, m/s; None where nothing is stated.
        day: of the recording, as `2018-05-02`.
    """

    weather: str = UNKNOWN
    daylight: str = UNKNOWN
    surface: str = UNKNOWN
    limit: float | None = None
    day: str = UNKNOWN

    def columns(self) -> dict[str, str]:
        """The values by column of an index."""
        return {name: getattr(self, name) for name in (*_CLASSES, _DAY)}

    def classes(self) -> list[str]:
        """Classes of OpenLABEL's ontology that the values have."""
        found = (known.get(getattr(self, name), "") for name, known in _CLASSES.items())
        return [one for one in found if one]


def conditions_of(path: Path, name: str, stated: OddConditions) -> OddConditions:
    """Conditions of a recording: those in the nearest `odd.toml`, before the
    ones that its data state.

    Args:
        path: main file of the recording.
        name: of the recording.
        stated: by its data.

    Raises:
        InvalidFile: the file is malformed, or states what is not known; names key and choices.
    """
    if stated.day == UNKNOWN:
        stated = stated._replace(day=_day_in(f"{path.parent.name}/{path.name}/{name}"))
    folders = list(path.absolute().parents)[:_LEVELS]
    file = next((one for folder in folders if (one := folder / _FILE).is_file()), None)
    if file is None:
        return stated
    try:
        found: dict[str, Any] = tomllib.loads(read_bytes(file).decode("utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InvalidFile(f"no TOML: {error}", path=file) from error
    named = found.pop(_RECORDINGS, {})
    tables = [found, *(named.values() if isinstance(named, dict) else [named])]
    if not all(isinstance(table, dict) for table in tables):
        raise InvalidFile(f'[{_RECORDINGS}."NAME"] is a table for each recording', path=file)
    for table in tables:
        _check(table, file)
    made = stated._replace(**found)._replace(**named.get(name, {}))
    return made._replace(day=str(made.day))


def _day_in(text: str) -> str:
    """Return the first date in a text; `UNKNOWN` without one."""
    for match in _DATE.finditer(text):
        with suppress(ValueError):
            return str(date.fromisoformat(match[1]))
    return UNKNOWN


def _is_date(value: Any) -> bool:
    """Whether a value of TOML is a date, or the text of one; a time of day is neither."""
    return type(value) is date or (isinstance(value, str) and _day_in(value) == value)


def _check(table: Mapping[str, Any], file: Path) -> None:
    for key, value in table.items():
        if key == _LIMIT:
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not (number and 0.0 < value <= _FASTEST):
                raise InvalidFile(
                    f"{key}: {value!r} is no speed of 0 to {_FASTEST:g} m/s", path=file
                )
        elif key == _DAY:
            if value != UNKNOWN and not _is_date(value):
                raise InvalidFile(f"{key}: {value} is no date as 2018-05-02", path=file)
        elif key not in _CLASSES:
            raise InvalidFile(f"{key!r}: {nearest(key, [*_CLASSES, _LIMIT, _DAY])}", path=file)
        elif value != UNKNOWN and value not in _CLASSES[key]:
            choices = ", ".join([*_CLASSES[key], UNKNOWN])
            raise InvalidFile(f"{key}: {value!r} is none of {choices}", path=file)


# daylight from clock and place ----------------------------------------------------------------

_AXIS = 23.44
"""Obliquity of the earth's axis, degrees"""
_RISEN, _CIVIL, _UNSURE = -0.83, -6.0, 1.0
"""Elevation (degrees) of the sun's centre as its rim rises and at the end of civil twilight, and
error of the formula with refraction"""
_DAYS = (1, 8, 15, 22, 28)
"""Days of a month that stand for all"""


def daylight(
    latitude: float, longitude: float, months: Iterable[int], start: float, end: float
) -> str:
    """Daylight at a place in Central European Time; `UNKNOWN` unless it is the same on all days and
    at all hours that are possible.

    Source of declination and equation of time: Duffie and Beckman, Solar Engineering of Thermal
    Processes, chapter 1.

    Args:
        latitude, longitude: degrees, north and east.
        months: those possible, from 1.
        start, end: local time of the clock, h.
    """
    found = set[str]()
    for month in months:
        # Summer time begins in the last week of March and ends in that of October.
        offsets = (1, 2) if month in (3, 10) else (2,) if 3 < month < 10 else (1,)
        for day in _DAYS:
            for offset in offsets:
                for clock in _quarters(start, end):
                    height = _elevation(
                        latitude, longitude, 30.44 * (month - 1) + day, clock - offset
                    )
                    found |= {phase_of(height - _UNSURE), phase_of(height + _UNSURE)}
    return found.pop() if len(found) == 1 else UNKNOWN


def _quarters(start: float, end: float) -> list[float]:
    """Times from start to end at most a quarter of an hour apart, h."""
    count = max(math.ceil(4.0 * (end - start)), 1)
    return [start + (end - start) * number / count for number in range(count + 1)]


def phase_of(elevation: float) -> str:
    """Daylight by the elevation of the sun, degrees."""
    return "day" if elevation > _RISEN else "twilight" if elevation > _CIVIL else "night"


def _elevation(latitude: float, longitude: float, day: float, utc: float) -> float:
    """Elevation (degrees) of the sun on a day of the year at an hour of UTC."""
    declination = math.radians(_AXIS * math.sin(math.tau * (284.0 + day) / 365.0))
    turn = math.tau * (day - 81.0) / 364.0
    minutes = 9.87 * math.sin(2.0 * turn) - 7.53 * math.cos(turn) - 1.5 * math.sin(turn)
    hour = math.radians(15.0 * (utc + minutes / 60.0 - 12.0) + longitude)
    north = math.radians(latitude)
    return math.degrees(
        math.asin(
            math.sin(north) * math.sin(declination)
            + math.cos(north) * math.cos(declination) * math.cos(hour)
        )
    )


_CLOCK = re.compile(r"\s*(\d{1,2})(?:[:.](\d{2})(?::\d{2})?)?\s*")
_MONTH = re.compile(r"\s*(\d{1,2})(?:[./-]\d{4})?\s*")
_MONTHS = range(1, 13)


def daylight_of(meta: Path, latitude: float, longitude: float) -> str:
    """Daylight at a place by `startTime` (`08:38`, or the hour alone), `duration` (s) and `month`
    (`9` or `9.2017`; any month without it) in a table about a recording.

    The table may lack them, or hold anything else: daylight is unknown then.
    """
    there = {"startTime", "duration", "month"} & set(column_names(meta))
    try:
        table = read_table(meta, dict.fromkeys(sorted(there), "text"))
        clock = _CLOCK.fullmatch(str(table["startTime"][0]))
        lasts = float(table["duration"][0]) / 3600.0 if "duration" in there else 0.0
    except (InvalidFile, KeyError, ValueError):
        return UNKNOWN
    if clock is None or int(clock[1]) > 23 or int(clock[2] or 0) > 59 or not 0.0 <= lasts < 24.0:
        return UNKNOWN
    start = int(clock[1]) + int(clock[2] or 0) / 60.0
    month = _MONTH.fullmatch(str(table["month"][0])) if "month" in there else None
    known = month is not None and int(month[1]) in _MONTHS
    months = (int(month[1]),) if month is not None and known else _MONTHS
    # An hour without minutes may have begun at its end.
    return daylight(latitude, longitude, months, start, start + lasts + (0.0 if clock[2] else 1.0))
