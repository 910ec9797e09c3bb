"""Exposure: time and distance that vehicles were observed, and rates of events per hour and per
1,000 km by class and site."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from recognition.labels.classes import Rules
from recognition.labels.scene import EGOS, is_parked
from runner.recording import Recording

EVERYWHERE = "all"
"""Site and class of totals"""
COLUMNS: dict[str, type] = {
    "site": str, "class": str, "events": int, "vehicles": int, "vehicle_hours": float,
    "vehicle_km": float, "quality": float,
    "per_hour": float, "per_hour_low": float, "per_hour_high": float,
    "per_1000_km": float, "per_1000_km_low": float, "per_1000_km_high": float,
}  # fmt: skip
"""Columns of the table beside the index: events, exposure with its quality from 0 to 1, rates with
their 95 % intervals"""
_LEVEL = 0.95
_HOUR, _KM = 3600.0, 1000.0


class Mileage(NamedTuple):
    """Motor vehicles that were not parked: their number, the sum of their times (s) and of their
    distances (m).

    quality: of the recording, from 0 to 1. blocked: classes that are not labelled everywhere there,
    because roles of lanes are not sure.
    """

    vehicles: int
    time: float
    distance: float
    quality: float = 1.0
    blocked: frozenset[str] = frozenset()

    def __add__(self, other: Mileage) -> Mileage:  # type: ignore[override]
        """Both together; the quality is the mean by time."""
        time = self.time + other.time
        quality = (
            (self.quality * self.time + other.quality * other.time) / time
            if time > 0.0
            else other.quality
        )
        return Mileage(
            self.vehicles + other.vehicles,
            time,
            self.distance + other.distance,
            quality,
            self.blocked | other.blocked,
        )


def exposure_of(recording: Recording, rules: Rules) -> Mileage:
    """Return the exposure of a recording: that of the vehicles that rules may find as egos."""
    # The same vehicles that can be egos of events: else a rate would count driving in which no
    # event can be found.
    motor = [
        track
        for track in recording.tracks.values()
        if track.kind == "vehicle" and track.category in EGOS
    ]
    moving = [
        track.columns
        for track in motor
        if len(track.columns["time"]) and not is_parked(track, rules)
    ]
    time = sum(float(np.ptp(columns["time"])) for columns in moving)
    distance = sum(
        float(np.hypot(np.diff(columns["x"]), np.diff(columns["y"])).sum()) for columns in moving
    )
    return Mileage(len(moving), time, distance)


def rates(
    rows: Iterable[Mapping[str, Any]], sites: Sequence[tuple[str, Mileage]]
) -> list[dict[str, Any]]:
    """Return the rates of all classes at all sites and at all sites together.

    A class that occurs at one site has a row for each: its upper limit says what absence shows.
    Rates are absent without exposure, and of classes that are blocked; all sites together are those
    where a class is not.

    Args:
        rows: of the index.
        sites: site and exposure of each recording.
    """
    events = Counter((_own(str(row["site"])), str(row["class"])) for row in rows)
    total: dict[str, Mileage] = {}
    for site, one in sites:
        total[_own(site)] = total.get(_own(site), Mileage(0, 0.0, 0.0)) + one

    def seen(site: str, title: str) -> Mileage:
        if site != EVERYWHERE:
            return total[site]
        open_sites = [one for one in total.values() if title not in one.blocked]
        # A class that is blocked at a site was not looked for there: its exposure must not dilute
        # the rate.
        parts = open_sites or list(total.values())
        return sum(parts[1:], parts[0])

    for (site, title), count in list(events.items()):
        if title not in total[site].blocked or all(title in one.blocked for one in total.values()):
            events[EVERYWHERE, title] += count
    for (site, _), count in list(events.items()):
        events[site, EVERYWHERE] += count
    # Only what occurs anywhere: for other classes the recordings may not show that they can.
    classes = sorted({title for _, title in events} - {EVERYWHERE})
    return [
        _row(site, title, events[site, title], seen(site, title))
        for site in (*sorted(total), *([EVERYWHERE] if total else []))
        for title in (*classes, *([EVERYWHERE] if classes else []))
    ]


def _own(site: str) -> str:
    """Name of a site in the table."""
    # A site called as the total is would be counted twice in it.
    return f"site {site}" if site == EVERYWHERE else site


def _row(site: str, title: str, count: int, seen: Mileage) -> dict[str, Any]:
    hours, km = seen.time / _HOUR, seen.distance / _KM
    row = {"site": site, "class": title, "events": count, "vehicles": seen.vehicles}
    row |= {
        "vehicle_hours": round(hours, 4),
        "vehicle_km": round(km, 3),
        "quality": round(seen.quality, 4),
    }
    for name, amount in (("per_hour", hours), ("per_1000_km", km / 1000.0)):
        known = amount > 0.0 and title not in seen.blocked
        values = [number / amount for number in (count, *interval(count))] if known else [None] * 3
        row |= {
            f"{name}{end}": value and round(value, 4)
            for end, value in zip(("", "_low", "_high"), values, strict=True)
        }
    return row


def interval(count: int) -> tuple[float, float]:
    """Return the exact two-sided 95 % interval of the mean of a Poisson variable that was observed
    once.

    Source: F. Garwood, Fiducial Limits for the Poisson Distribution, Biometrika 28 (1936).
    """
    from scipy.stats import chi2

    tail = 0.5 * (1.0 - _LEVEL)
    # With no event the lower limit is 0, and χ² with 0 degrees of freedom is not defined.
    low = 0.5 * float(chi2.ppf(tail, 2 * count)) if count else 0.0
    return low, 0.5 * float(chi2.ppf(1.0 - tail, 2 * count + 2))
