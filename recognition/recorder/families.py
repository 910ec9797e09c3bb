"""Sites without end: maps, traffic and sensors drawn from a seed, so that a model is tested on no map that it was trained on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from recognition.recorder.demand import Flow, Parking
from recognition.recorder.fleet import MOTORWAY, TOWN, Fleet, Normal
from recognition.recorder.maps import kerbside
from recognition.recorder.sensor import EXACT, Sensor
from recognition.recorder.sites import Site, View, evenly, junction
from xodr.builders import (
    RoadMap,
    four_way_intersection,
    narrow_road,
    off_ramp,
    on_ramp,
    roundabout,
    sharp_curve,
    straight_highway,
    t_junction,
)

_KMH = 1.0 / 3.6
Draw = np.random.Generator


def family(seed: int, count: int) -> dict[str, Site]:
    """So many sites, each with a map of its own: `KINDS` one after the other, everything about them drawn.

    Lane counts and widths, radii, angles, arms, lights, speed limits, lengths of ramps, density and pace of traffic, and noise,
    distortion, dropped tracks and cut tracks of the sensor differ from site to site. Sites of different seeds have no map in
    common.
    """
    kinds = list(KINDS.items())
    found = {}
    for number in range(count):
        kind, build = kinds[number % len(kinds)]
        rng = np.random.default_rng((seed, number))
        name = f"{kind}_{seed:02d}_{number:03d}"
        found[name] = replace(build(name, rng), sensor=_sensor(rng))
    return found


def _sensor(rng: Draw) -> Sensor:
    """Half of all sensors are exact."""
    if rng.random() < 0.5:
        return EXACT
    return Sensor(
        noise=float(rng.uniform(0.02, 0.25)), distortion=float(rng.uniform(0.0, 0.7)), dropped=float(rng.uniform(0.0, 0.1)),
        cut=float(rng.uniform(0.0, 0.6)),
    )  # fmt: skip


def _paced(fleet: Fleet, rng: Draw) -> Fleet:
    """The fleet in traffic that is slower than the limit, or no slower."""
    pace = float(rng.uniform(0.5, 1.1))
    return fleet._replace(
        kinds={
            kind._replace(speed_factor=Normal(pace * kind.speed_factor.mean, kind.speed_factor.sd)): share
            for kind, share in fleet.kinds.items()
        }
    )


def _motorway(name: str, rng: Draw) -> Site:
    """A straight motorway, recorded as highD is."""
    lanes, limit = int(rng.integers(2, 6)), float(rng.uniform(80.0, 140.0))
    width = float(rng.uniform(3.2, 4.0))
    build = partial(
        straight_highway, lanes=lanes, opposite_lanes=lanes, lane_width=width, length=1400.0, speed_limit=limit * _KMH
    )
    rate = float(rng.uniform(300.0, 1700.0)) * lanes
    flows = (Flow(("1", -1), ("1", -1), rate), Flow(("1", 2), ("1", 2), rate))
    return Site(name, "highD", build, View(450.0, -30.0, 1050.0, 40.0), flows, _paced(MOTORWAY, rng), 1, 0.7)


def _bend(name: str, rng: Draw) -> Site:
    """A motorway in a bend."""
    lanes, limit = int(rng.integers(2, 6)), float(rng.uniform(80.0, 130.0))
    build = partial(
        sharp_curve, radius=float(rng.uniform(400.0, 1500.0)), angle=float(rng.uniform(0.2, 0.6)),
        turn=str(rng.choice(["left", "right"])), lanes=lanes, opposite_lanes=0, lane_width=float(rng.uniform(3.2, 4.0)),
        approach=350.0, speed_limit=limit * _KMH,
    )  # fmt: skip
    flows = (Flow(("1", -1), ("1", -1), float(rng.uniform(300.0, 1700.0)) * lanes),)
    return Site(name, "INTERACTION", build, View(150.0, -450.0, 800.0, 450.0), flows, _paced(MOTORWAY, rng), 1, 0.7)


def _ramp_sizes(rng: Draw) -> dict[str, float]:
    limit = float(rng.uniform(80.0, 130.0))
    return {
        "lanes": int(rng.integers(1, 5)), "lane_width": float(rng.uniform(3.2, 4.0)), "ramp_width": float(rng.uniform(3.4, 4.5)),
        "taper": float(rng.uniform(40.0, 100.0)), "ramp": 300.0, "angle": float(rng.uniform(0.05, 0.12)),
        "speed_limit": limit * _KMH, "ramp_speed_limit": float(rng.uniform(60.0, 80.0)) * _KMH,
    }  # fmt: skip


def _on_ramp(name: str, rng: Draw) -> Site:
    sizes = _ramp_sizes(rng)
    build = partial(on_ramp, acceleration=float(rng.uniform(120.0, 350.0)), **sizes)  # type: ignore[arg-type]
    main = float(rng.uniform(300.0, 1100.0)) * sizes["lanes"]
    flows = (Flow(("1", -1), ("2", -1), main), Flow(("3", -1), ("2", -1), float(rng.uniform(400.0, 900.0))))
    return Site(name, "INTERACTION", build, View(330.0, -60.0, 1000.0, 30.0), flows, _paced(MOTORWAY, rng), 1, 1.5)


def _off_ramp(name: str, rng: Draw) -> Site:
    sizes = _ramp_sizes(rng)
    build = partial(off_ramp, deceleration=float(rng.uniform(120.0, 350.0)), **sizes)  # type: ignore[arg-type]
    main = float(rng.uniform(300.0, 1100.0)) * sizes["lanes"]
    flows = (Flow(("1", -1), ("2", -1), main), Flow(("1", -1), ("3", -1), float(rng.uniform(400.0, 1000.0))))
    return Site(name, "INTERACTION", build, View(430.0, -60.0, 1150.0, 30.0), flows, _paced(MOTORWAY, rng), 1, 1.5)


def _street(name: str, build: Callable[[], RoadMap], view: View, rate: float, minutes: float, rng: Draw) -> Site:
    flows = (Flow(("1", -1), ("1", -1), rate), Flow(("1", 1), ("1", 1), rate))
    return Site(name, "INTERACTION", build, view, flows, _paced(TOWN, rng), 1, minutes)


def _arterial(name: str, rng: Draw) -> Site:
    lanes = int(rng.integers(2, 5))
    build = partial(
        narrow_road, lanes=lanes, opposite_lanes=lanes, lane_width=float(rng.uniform(2.8, 3.6)), length=700.0,
        speed_limit=float(rng.uniform(40.0, 70.0)) * _KMH,
    )  # fmt: skip
    return _street(name, build, View(120.0, -40.0, 580.0, 40.0), float(rng.uniform(300.0, 800.0)) * lanes, 1.0, rng)


def _arterial_bend(name: str, rng: Draw) -> Site:
    lanes = int(rng.integers(2, 4))
    build = partial(
        sharp_curve, radius=float(rng.uniform(120.0, 500.0)), angle=float(rng.uniform(0.3, 1.2)),
        turn=str(rng.choice(["left", "right"])), lanes=lanes, opposite_lanes=lanes, lane_width=float(rng.uniform(2.8, 3.6)),
        approach=250.0, speed_limit=float(rng.uniform(45.0, 70.0)) * _KMH,
    )  # fmt: skip
    return _street(name, build, View(100.0, -400.0, 700.0, 400.0), float(rng.uniform(300.0, 750.0)) * lanes, 1.0, rng)


def _kerbside(name: str, rng: Draw) -> Site:
    lanes = int(rng.integers(1, 3))
    build = partial(
        kerbside,
        lanes=lanes,
        lane_width=float(rng.uniform(2.9, 3.5)),
        kerb=300.0,
        speed_limit=float(rng.uniform(45.0, 70.0)) * _KMH,
    )
    site = _street(name, build, View(120.0, -40.0, 630.0, 40.0), float(rng.uniform(400.0, 800.0)), 3.0, rng)
    spacing = float(rng.uniform(12.0, 20.0))
    rows = tuple(Parking(("1", (lanes + 1) * side), 235.0, 515.0, spacing, ("1", side)) for side in (-1, 1))
    return replace(site, parking=rows)


def _roundabout(name: str, rng: Draw) -> Site:
    arms, lanes = int(rng.integers(3, 7)), int(rng.integers(1, 3))
    build = partial(
        roundabout, arms=arms, lanes=lanes, lane_width=float(rng.uniform(3.4, 4.8)),
        radius=float(rng.uniform(10.0 + 2.5 * arms, 34.0)),
        flare=float(rng.uniform(11.0, 20.0)), speed_limit=float(rng.uniform(30.0, 60.0)) * _KMH,
        ring_speed_limit=float(rng.uniform(25.0, 40.0)) * _KMH,
    )  # fmt: skip
    flows = evenly("123456"[:arms], float(rng.uniform(150.0, 400.0)))
    return replace(junction(name, build, 130.0, flows, 1, 1.2), fleet=_paced(TOWN, rng))


def _crossing_sizes(rng: Draw) -> dict[str, float]:
    """Of small junctions and large ones, half of them with lights."""
    return {
        "lanes": int(rng.integers(1, 4)), "lane_width": float(rng.uniform(2.8, 4.0)),
        "corner_radius": float(rng.uniform(5.0, 25.0)),
        "speed_limit": float(rng.uniform(30.0, 60.0)) * _KMH, "signals": bool(rng.random() < 0.5),
    }  # fmt: skip


def _crossing(name: str, rng: Draw) -> Site:
    build = partial(four_way_intersection, **_crossing_sizes(rng))  # type: ignore[arg-type]
    flows = evenly("1234", float(rng.uniform(150.0, 450.0)))
    return replace(junction(name, build, float(rng.uniform(50.0, 110.0)), flows, 1, 4.0), fleet=_paced(TOWN, rng))


def _t_junction(name: str, rng: Draw) -> Site:
    build = partial(t_junction, **_crossing_sizes(rng))  # type: ignore[arg-type]
    usual = {"31": 500.0, "41": 350.0, "13": 300.0, "14": 120.0, "34": 120.0, "43": 150.0}
    flows = {way: rate * float(rng.uniform(0.5, 1.5)) for way, rate in usual.items()}
    return replace(junction(name, build, float(rng.uniform(50.0, 110.0)), flows, 1, 4.0), fleet=_paced(TOWN, rng))


KINDS: dict[str, Callable[[str, Draw], Site]] = {
    "motorway": _motorway,
    "crossing": _crossing,
    "on_ramp": _on_ramp,
    "roundabout": _roundabout,
    "bend": _bend,
    "t_junction": _t_junction,
    "off_ramp": _off_ramp,
    "kerbside": _kerbside,
    "arterial": _arterial,
    "arterial_bend": _arterial_bend,
}
"""What draws a site of each kind, by the beginning of its name."""
