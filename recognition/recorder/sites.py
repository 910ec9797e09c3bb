"""Sites for recorded traffic with maps of their own, and families of sites drawn from a seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations
from typing import Literal, NamedTuple

import numpy as np

from recognition.recorder.simulation import EXACT, Sensor
from recognition.recorder.traffic import MOTORWAY, TOWN, Fleet, Flow, Normal, Parking
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
from xodr.builders.elements import LaneDesign, PlanPose, RoadDesign, SectionDesign, line
from xodr.builders.roads_and_ramps import carriageway, closing, constant, linked, opening
from xodr.model.geometry import Cubic


def kerbside(
    *, lanes: int = 2, lane_width: float = 3.25, approach: float = 200.0, taper: float = 25.0,
    kerb: float = 250.0,
    speed_limit: float = 50 / 3.6,
) -> RoadMap:  # fmt: skip
    """A straight street along the x axis with a lane at either kerb, for a while, in which people
    stop.

    Args:
        lanes: through lanes each way, with ids ±1 … ±lanes; the kerb's lanes come next.
        approach: length of road before and behind. kerb: of the lane at full width. taper: of its
            beginning and end.
        lane_width: m. speed_limit: m/s.
    """
    extra = lanes + 1

    def wide(s: float, width: tuple[Cubic, ...], before: bool, behind: bool) -> SectionDesign:
        layout = carriageway(extra, lane_width) | carriageway(extra, lane_width, side=1)
        layout |= {side * extra: LaneDesign("driving", width, mark="solid") for side in (1, -1)}
        through = {key: key for key in layout if abs(key) <= lanes}
        return linked(
            SectionDesign(s, layout, "solid solid"),
            None if before else through,
            None if behind else through,
        )

    plain = carriageway(lanes, lane_width) | carriageway(lanes, lane_width, side=1)
    ends = approach + taper, approach + taper + kerb, approach + 2 * taper + kerb
    sections = (
        linked(SectionDesign(0.0, plain, "solid solid"), {}, None),
        wide(approach, opening(lane_width, taper), before=False, behind=True),
        wide(ends[0], constant(lane_width), before=True, behind=True),
        wide(ends[1], closing(lane_width, taper), before=True, behind=False),
        linked(SectionDesign(ends[2], plain, "solid solid"), None, {}),
    )
    road = RoadDesign(
        "1",
        "Street",
        PlanPose(0.0, 0.0, 0.0),
        (line(ends[2] + approach),),
        sections,
        "town",
        speed_limit,
    )
    return RoadMap("Street with stops at the kerb", (road,))


Layout = Literal["highD", "INTERACTION"]


class CameraView(NamedTuple):
    """View of the camera, a rectangle of the map, m."""

    left: float
    bottom: float
    right: float
    top: float


@dataclass(frozen=True)
class SimulatedSite:
    """A place with its usual traffic.

    Attributes:
        layout: format of its recordings. highD takes straight motorways along the x axis only.
        flows: traffic on an average day; each recording has some more or less of it.
        recordings, minutes: number of recordings and length of each at scale 1.
        parking: rows of vehicles that stand at the kerb.
        sensor: what records.
    """

    name: str
    layout: Layout
    road_map: Callable[[], RoadMap]
    view: CameraView
    flows: tuple[Flow, ...]
    fleet: Fleet
    recordings: int
    minutes: float
    parking: tuple[Parking, ...] = ()
    sensor: Sensor = EXACT


def _fixed_motorway(
    name: str, lanes: int, limit: float, rate: float, recordings: int, minutes: float
) -> SimulatedSite:
    """Both carriageways of a straight motorway; the limit in km/h, the rate in vehicles per hour
    and direction."""
    build = partial(
        straight_highway, lanes=lanes, opposite_lanes=lanes, length=1400.0, speed_limit=limit / 3.6
    )
    flows = (Flow(("1", -1), ("1", -1), rate), Flow(("1", 2), ("1", 2), rate))
    return SimulatedSite(
        name,
        "highD",
        build,
        CameraView(400.0, -30.0, 1250.0, 40.0),
        flows,
        MOTORWAY,
        recordings,
        minutes,
    )


def _fixed_street(
    name: str, build: Callable[[], RoadMap], view: CameraView, rate: float, recordings: int,
    minutes: float,
    parking: tuple[Parking, ...] = (),
) -> SimulatedSite:  # fmt: skip
    """A street through a town, with the rate of each direction."""
    flows = (Flow(("1", -1), ("1", -1), rate), Flow(("1", 1), ("1", 1), rate))
    return SimulatedSite(
        name, "INTERACTION", build, view, flows, TOWN, recordings, minutes, parking
    )


def junction(
    name: str,
    build: Callable[[], RoadMap],
    reach: float,
    flows: dict[str, float],
    recordings: int,
    minutes: float,
) -> SimulatedSite:
    """Roads that lead away from a place; "12": 300 are 300 vehicles per hour
    from road 1 to road 2.
    """
    found = tuple(Flow((way[0], 1), (way[1], -1), rate) for way, rate in flows.items())
    return SimulatedSite(
        name,
        "INTERACTION",
        build,
        CameraView(-reach, -reach, reach, reach),
        found,
        TOWN,
        recordings,
        minutes,
    )


def evenly(arms: str, rate: float) -> dict[str, float]:
    """The same traffic from each road, evenly to all others."""
    return {f"{here}{there}": rate / (len(arms) - 1) for here, there in permutations(arms, 2)}


def _ramp(
    name: str,
    build: Callable[[], RoadMap],
    flows: tuple[Flow, ...],
    recordings: int,
    minutes: float,
) -> SimulatedSite:
    return SimulatedSite(
        name,
        "INTERACTION",
        build,
        CameraView(330.0, -60.0, 1200.0, 30.0),
        flows,
        MOTORWAY,
        recordings,
        minutes,
    )


_ENTERING = (Flow(("1", -1), ("2", -1), 1500.0), Flow(("3", -1), ("2", -1), 800.0))
_EXITING = (Flow(("1", -1), ("2", -1), 2000.0), Flow(("1", -1), ("3", -1), 1000.0))
_KERB = tuple(Parking(("1", 2 * side), 235.0, 515.0, 14.0, ("1", side)) for side in (-1, 1))

SITES: dict[str, SimulatedSite] = {
    site.name: site
    for site in (
        _fixed_motorway("motorway_sparse", 3, 130.0, 700.0, 12, 3.0),
        _fixed_motorway("motorway_two_lanes", 2, 120.0, 2400.0, 12, 3.0),
        _fixed_motorway("motorway_three_lanes", 3, 130.0, 4200.0, 12, 3.0),
        _ramp("on_ramp", partial(on_ramp, ramp=300.0), _ENTERING, 44, 5.0),
        _ramp("off_ramp", partial(off_ramp, ramp=300.0), _EXITING, 40, 5.0),
        _fixed_street(
            "arterial", partial(narrow_road, lanes=3, opposite_lanes=3, lane_width=3.25,
                length=700.0, speed_limit=50 / 3.6),
            CameraView(120.0, -40.0, 580.0, 40.0), 2000.0, 20, 2.0,
        ),
        _fixed_street(
            "arterial_curve",
            partial(sharp_curve, radius=500.0, angle=0.7, lanes=2, opposite_lanes=2, approach=250.0,
                speed_limit=70 / 3.6),
            CameraView(120.0, -40.0, 660.0, 250.0), 1300.0, 20, 2.0,
        ),
        _fixed_street(
            "kerbside", partial(kerbside, lanes=1, kerb=300.0, speed_limit=70 / 3.6),
            CameraView(120.0, -40.0, 630.0, 40.0), 700.0, 375, 1.0, _KERB,
        ),
        junction("roundabout", roundabout, 120.0, evenly("1234", 350.0), 22, 2.5),
        junction("roundabout_five_arms", partial(roundabout, arms=5, radius=22.0), 120.0,
            evenly("12345", 300.0), 22, 2.5),
        junction("crossing", four_way_intersection, 120.0, evenly("1234", 300.0), 90, 4.0),
        junction(
            "t_junction", t_junction, 120.0,
            {"31": 700.0, "41": 350.0, "13": 200.0, "14": 60.0, "34": 60.0, "43": 60.0}, 80, 6.0
        ),
    )
}  # fmt: skip
"""By name."""

_KMH = 1.0 / 3.6
Draw = np.random.Generator


def family(seed: int, count: int) -> dict[str, SimulatedSite]:
    """Draw sites, each with its own map, of all `KINDS` in turn.

    Lane counts and widths, radii, angles, arms, lights, speed limits, lengths of ramps, density and
    pace of traffic, and noise, distortion, dropped tracks and cut tracks of the sensor differ from
    site to site. Sites of different seeds have no map in common.
    """
    kinds = list(KINDS.items())
    found = {}
    for number in range(count):
        kind, build = kinds[number % len(kinds)]
        # A generator for each site: a greater count does not change the first ones.
        rng = np.random.default_rng((seed, number))
        name = f"{kind}_{seed:02d}_{number:03d}"
        found[name] = replace(build(name, rng), sensor=_sensor(rng))
    return found


def _sensor(rng: Draw) -> Sensor:
    """Half of all sensors are exact."""
    if rng.random() < 0.5:
        return EXACT
    return Sensor(
        noise=float(rng.uniform(0.02, 0.25)), distortion=float(rng.uniform(0.0, 0.7)),
        dropped=float(rng.uniform(0.0, 0.1)),
        cut=float(rng.uniform(0.0, 0.6)),
    )  # fmt: skip


def _paced(fleet: Fleet, rng: Draw) -> Fleet:
    """The fleet in traffic that is slower than the limit, or no slower."""
    pace = float(rng.uniform(0.5, 1.1))
    return fleet._replace(
        kinds={
            kind._replace(
                speed_factor=Normal(pace * kind.speed_factor.mean, kind.speed_factor.sd)
            ): share
            for kind, share in fleet.kinds.items()
        }
    )


def _motorway(name: str, rng: Draw) -> SimulatedSite:
    """A straight motorway, recorded as highD is."""
    lanes, limit = int(rng.integers(2, 6)), float(rng.uniform(80.0, 140.0))
    width = float(rng.uniform(3.2, 4.0))
    build = partial(
        straight_highway,
        lanes=lanes,
        opposite_lanes=lanes,
        lane_width=width,
        length=1400.0,
        speed_limit=limit * _KMH,
    )
    rate = float(rng.uniform(300.0, 1700.0)) * lanes
    flows = (Flow(("1", -1), ("1", -1), rate), Flow(("1", 2), ("1", 2), rate))
    return SimulatedSite(
        name,
        "highD",
        build,
        CameraView(450.0, -30.0, 1050.0, 40.0),
        flows,
        _paced(MOTORWAY, rng),
        1,
        0.7,
    )


def _bend(name: str, rng: Draw) -> SimulatedSite:
    """A motorway in a bend."""
    lanes, limit = int(rng.integers(2, 6)), float(rng.uniform(80.0, 130.0))
    build = partial(
        sharp_curve, radius=float(rng.uniform(400.0, 1500.0)), angle=float(rng.uniform(0.2, 0.6)),
        turn=str(rng.choice(["left", "right"])), lanes=lanes, opposite_lanes=0,
        lane_width=float(rng.uniform(3.2, 4.0)),
        approach=350.0, speed_limit=limit * _KMH,
    )  # fmt: skip
    flows = (Flow(("1", -1), ("1", -1), float(rng.uniform(300.0, 1700.0)) * lanes),)
    return SimulatedSite(
        name,
        "INTERACTION",
        build,
        CameraView(150.0, -450.0, 800.0, 450.0),
        flows,
        _paced(MOTORWAY, rng),
        1,
        0.7,
    )


def _ramp_sizes(rng: Draw) -> dict[str, float]:
    limit = float(rng.uniform(80.0, 130.0))
    return {
        "lanes": int(rng.integers(1, 5)), "lane_width": float(rng.uniform(3.2, 4.0)),
        "ramp_width": float(rng.uniform(3.4, 4.5)),
        "taper": float(rng.uniform(40.0, 100.0)), "ramp": 300.0,
        "angle": float(rng.uniform(0.05, 0.12)),
        "speed_limit": limit * _KMH, "ramp_speed_limit": float(rng.uniform(60.0, 80.0)) * _KMH,
    }  # fmt: skip


def _on_ramp(name: str, rng: Draw) -> SimulatedSite:
    sizes = _ramp_sizes(rng)
    build = partial(on_ramp, acceleration=float(rng.uniform(120.0, 350.0)), **sizes)  # type: ignore[arg-type]
    main = float(rng.uniform(300.0, 1100.0)) * sizes["lanes"]
    flows = (
        Flow(("1", -1), ("2", -1), main),
        Flow(("3", -1), ("2", -1), float(rng.uniform(400.0, 900.0))),
    )
    return SimulatedSite(
        name,
        "INTERACTION",
        build,
        CameraView(330.0, -60.0, 1000.0, 30.0),
        flows,
        _paced(MOTORWAY, rng),
        1,
        1.5,
    )


def _off_ramp(name: str, rng: Draw) -> SimulatedSite:
    sizes = _ramp_sizes(rng)
    build = partial(off_ramp, deceleration=float(rng.uniform(120.0, 350.0)), **sizes)  # type: ignore[arg-type]
    main = float(rng.uniform(300.0, 1100.0)) * sizes["lanes"]
    flows = (
        Flow(("1", -1), ("2", -1), main),
        Flow(("1", -1), ("3", -1), float(rng.uniform(400.0, 1000.0))),
    )
    return SimulatedSite(
        name,
        "INTERACTION",
        build,
        CameraView(430.0, -60.0, 1150.0, 30.0),
        flows,
        _paced(MOTORWAY, rng),
        1,
        1.5,
    )


def _street(
    name: str,
    build: Callable[[], RoadMap],
    view: CameraView,
    rate: float,
    minutes: float,
    rng: Draw,
) -> SimulatedSite:
    flows = (Flow(("1", -1), ("1", -1), rate), Flow(("1", 1), ("1", 1), rate))
    return SimulatedSite(name, "INTERACTION", build, view, flows, _paced(TOWN, rng), 1, minutes)


def _arterial(name: str, rng: Draw) -> SimulatedSite:
    lanes = int(rng.integers(2, 5))
    build = partial(
        narrow_road, lanes=lanes, opposite_lanes=lanes, lane_width=float(rng.uniform(2.8, 3.6)),
        length=700.0,
        speed_limit=float(rng.uniform(40.0, 70.0)) * _KMH,
    )  # fmt: skip
    return _street(
        name,
        build,
        CameraView(120.0, -40.0, 580.0, 40.0),
        float(rng.uniform(300.0, 800.0)) * lanes,
        1.0,
        rng,
    )


def _arterial_bend(name: str, rng: Draw) -> SimulatedSite:
    lanes = int(rng.integers(2, 4))
    build = partial(
        sharp_curve, radius=float(rng.uniform(120.0, 500.0)), angle=float(rng.uniform(0.3, 1.2)),
        turn=str(rng.choice(["left", "right"])), lanes=lanes, opposite_lanes=lanes,
        lane_width=float(rng.uniform(2.8, 3.6)),
        approach=250.0, speed_limit=float(rng.uniform(45.0, 70.0)) * _KMH,
    )  # fmt: skip
    return _street(
        name,
        build,
        CameraView(100.0, -400.0, 700.0, 400.0),
        float(rng.uniform(300.0, 750.0)) * lanes,
        1.0,
        rng,
    )


def _kerbside(name: str, rng: Draw) -> SimulatedSite:
    lanes = int(rng.integers(1, 3))
    build = partial(
        kerbside,
        lanes=lanes,
        lane_width=float(rng.uniform(2.9, 3.5)),
        kerb=300.0,
        speed_limit=float(rng.uniform(45.0, 70.0)) * _KMH,
    )
    site = _street(
        name,
        build,
        CameraView(120.0, -40.0, 630.0, 40.0),
        float(rng.uniform(400.0, 800.0)),
        3.0,
        rng,
    )
    spacing = float(rng.uniform(12.0, 20.0))
    rows = tuple(
        Parking(("1", (lanes + 1) * side), 235.0, 515.0, spacing, ("1", side)) for side in (-1, 1)
    )
    return replace(site, parking=rows)


def _roundabout(name: str, rng: Draw) -> SimulatedSite:
    arms, lanes = int(rng.integers(3, 7)), int(rng.integers(1, 3))
    # More arms need a larger ring.
    build = partial(
        roundabout, arms=arms, lanes=lanes, lane_width=float(rng.uniform(3.4, 4.8)),
        radius=float(rng.uniform(10.0 + 2.5 * arms, 34.0)),
        flare=float(rng.uniform(11.0, 20.0)), speed_limit=float(rng.uniform(30.0, 60.0)) * _KMH,
        ring_speed_limit=float(rng.uniform(25.0, 40.0)) * _KMH,
    )  # fmt: skip
    flows = evenly("123456"[:arms], float(rng.uniform(150.0, 400.0)))
    return replace(junction(name, build, 130.0, flows, 1, 1.2), fleet=_paced(TOWN, rng))


def _crossing_sizes(rng: Draw) -> dict[str, float]:
    """Sizes of small junctions and large ones, half of them with lights."""
    return {
        "lanes": int(rng.integers(1, 4)), "lane_width": float(rng.uniform(2.8, 4.0)),
        "corner_radius": float(rng.uniform(5.0, 25.0)),
        "speed_limit": float(rng.uniform(30.0, 60.0)) * _KMH, "signals": bool(rng.random() < 0.5),
    }  # fmt: skip


def _crossing(name: str, rng: Draw) -> SimulatedSite:
    build = partial(four_way_intersection, **_crossing_sizes(rng))  # type: ignore[arg-type]
    flows = evenly("1234", float(rng.uniform(150.0, 450.0)))
    return replace(
        junction(name, build, float(rng.uniform(50.0, 110.0)), flows, 1, 4.0),
        fleet=_paced(TOWN, rng),
    )


def _t_junction(name: str, rng: Draw) -> SimulatedSite:
    build = partial(t_junction, **_crossing_sizes(rng))  # type: ignore[arg-type]
    usual = {"31": 500.0, "41": 350.0, "13": 300.0, "14": 120.0, "34": 120.0, "43": 150.0}
    flows = {way: rate * float(rng.uniform(0.5, 1.5)) for way, rate in usual.items()}
    return replace(
        junction(name, build, float(rng.uniform(50.0, 110.0)), flows, 1, 4.0),
        fleet=_paced(TOWN, rng),
    )


KINDS: dict[str, Callable[[str, Draw], SimulatedSite]] = {
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
"""Functions that draw a site of a kind, by the beginning of its name."""
