"""One motorway with ramps, cut into roads in three ways, and simulated traffic
whose routes are known.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from recognition.labels import LabelledEvent, label
from recognition.recorder.simulation import VehicleMotion, motion, simulate
from recognition.recorder.traffic import MOTORWAY, Departure, Flow, departures
from recognition.recordings.source import REAR_AXLE, participant
from recognition.scenes import Site, site_at
from runner.recording import Recording, Track
from xodr.builders import RoadMap
from xodr.builders.elements import LaneDesign, PlanPose, RoadDesign, SectionDesign, connection, line
from xodr.builders.roads_and_ramps import closing, constant, opening
from xodr.formats.sumo_net import build
from xodr.model import Connection, Junction, RoadLink
from xodr.model.geometry import Cubic
from xodr.reader import load

Cutting = Literal["sections", "roads", "lanelets"]
WIDTH, TAPER, PIECE, RAMP, ANGLE = 3.75, 60.0, 70.0, 200.0, 0.07
RATE = 10


class Extra(NamedTuple):
    """A lane beside the through lanes, from x to x at full width (m), and
    whether a ramp leads into it or out of it.
    """

    start: float
    end: float
    entering: bool
    leaving: bool


@dataclass(frozen=True)
class Motorway:
    """A straight carriageway along x.

    Attributes:
        length: m. lanes: through lanes. extras: lanes beside them, from the left to the right end.
        against: whether the reference lines run against the traffic.
        limit, slow: speed limits of carriageway and ramps, m/s.
    """

    length: float
    lanes: int
    extras: tuple[Extra, ...]
    against: bool = False
    limit: float = 33.3
    slow: float = 22.2

    def road_map(self, cutting: Cutting) -> RoadMap:
        """The map, for right-hand traffic; `lanelets` has the roads of `sections`."""
        return _Builder(self, cutting == "roads").built()

    def write(self, cutting: Cutting, folder: Path, left: bool = False) -> Path:
        """Write the map as OpenDRIVE, mirrored for left-hand traffic."""
        built = self.road_map(cutting)
        path = (built.mirrored() if left else built).write(folder / f"{cutting}.xodr")
        if cutting != "lanelets":
            return path
        from xodr.formats.maps.converting import convert

        between = folder / "between.osm"
        convert(path, between)
        convert(between, folder / "lanelets.xodr", overwrite=True)
        return folder / "lanelets.xodr"


class _Builder:
    """Roads of a motorway, in the direction of traffic, and turned about at the end."""

    def __init__(self, plan: Motorway, apart: bool) -> None:
        self._plan, self._apart = plan, apart
        self._roads: list[RoadDesign] = []
        self._connections: dict[str, list[Connection]] = {}

    def built(self) -> RoadMap:
        plan = self._plan
        gores = {x for one in plan.extras for x in self._gores(one)}
        cuts = sorted({0.0, plan.length} | gores)
        if self._apart:
            cuts = sorted({*cuts, *np.arange(PIECE, plan.length - 1.0, PIECE).tolist()})
        pieces = list(pairwise(cuts))
        for number, (start, end) in enumerate(pieces):
            name = f"m{number}"
            before = self._mouth(start, f"m{number - 1}", name, "pred") if number else None
            last = number == len(pieces) - 1
            after = None if last else self._mouth(end, name, f"m{number + 1}", "succ")
            extra = not self._apart
            self._add(name, start, end, 0.0, self._main(start, end, extra), before, after)
        for number, one in enumerate(plan.extras):
            self._extra(number, one, pieces)
        junctions = tuple(
            Junction(key, key, "direct", tuple(found)) for key, found in self._connections.items()
        )
        return RoadMap("ramps", tuple(self._roads), junctions)

    def _gores(self, one: Extra) -> list[float]:
        return [x for x, gore in ((one.start, one.entering), (one.end, one.leaving)) if gore]

    def _mouth(self, x: float, before: str, after: str, side: str) -> RoadLink:
        """What a piece of the carriageway is linked to at x: its neighbour, or a
        junction with a ramp.
        """
        near = [one for one in self._plan.extras if x in self._gores(one)]
        if near and not self._apart:
            key = f"{1000 + round(x)}"
            if side == "succ":
                lanes = [(k, k) for k in range(1, self._plan.lanes + 1)]
                lanes += [
                    (self._plan.lanes + 1,) * 2
                    for one in self._plan.extras
                    if one.start < x < one.end
                ]
                self._connect(key, before, after, lanes)
            return RoadLink("junction", key, None)
        other = before if side == "pred" else after
        return RoadLink("road", other, "end" if side == "pred" else "start")

    def _connect(self, key: str, before: str, after: str, lanes: Iterable[tuple[int, int]]) -> None:
        sign = 1 if self._plan.against else -1
        made = connection(before, after, [(sign * a, sign * b) for a, b in lanes])
        if self._plan.against:
            made = made._replace(contact="end")
        self._connections.setdefault(key, []).append(made)

    def _main(
        self, start: float, end: float, extra: bool
    ) -> list[tuple[float, dict[int, tuple[Cubic, ...]]]]:
        """Sections from x on: widths of lanes by their number from the left."""
        plan = self._plan
        usual = {number: constant(WIDTH) for number in range(1, plan.lanes + 1)}
        found = [(start, dict(usual))]
        for one in plan.extras if extra else ():
            for x, width in self._widths(one):
                if start <= x < end:
                    found = [each for each in found if each[0] != x]
                    found.append((x, usual | ({plan.lanes + 1: width} if width else {})))
        return found

    def _widths(self, one: Extra) -> list[tuple[float, tuple[Cubic, ...] | None]]:
        """Widths of an extra lane from x on, None where it is no more."""
        found: list[tuple[float, tuple[Cubic, ...] | None]] = []
        if not one.entering and one.start > 0.0:
            found.append((one.start - TAPER, opening(WIDTH, TAPER)))
        found.append((one.start, constant(WIDTH)))
        if not one.leaving and one.end < self._plan.length:
            found += [(one.end, closing(WIDTH, TAPER)), (one.end + TAPER, None)]
        return found

    def _extra(self, number: int, one: Extra, pieces: Sequence[tuple[float, float]]) -> None:
        plan = self._plan
        edge = -plan.lanes * WIDTH
        names: list[str] = []
        if self._apart:
            start = one.start - (0.0 if one.entering or one.start == 0.0 else TAPER)
            end = one.end + (0.0 if one.leaving or one.end == plan.length else TAPER)
            cuts = sorted({start, end, *(x for piece in pieces for x in piece if start < x < end)})
            names = [f"x{number}_{k}" for k in range(len(cuts) - 1)]
            if one.entering:
                names.insert(0, f"r{number}on")
            if one.leaving:
                names.append(f"r{number}off")
            links = {
                name: (a, b)
                for a, name, b in zip([None, *names], names, [*names[1:], None], strict=False)
            }
            for k, (x, y) in enumerate(pairwise(cuts)):
                widths = [
                    (max(a, x), {1: width})
                    for a, width in self._widths(one)
                    if width and a < y and max(a, x) == a
                ] or [(x, {1: constant(WIDTH)})]
                if widths[0][0] > x:
                    widths.insert(0, (x, {1: constant(WIDTH)}))
                if x > one.end or (x < one.start and x > one.start - TAPER):
                    widths = [(x, {1: constant(0.4 * WIDTH)})]
                before, after = links[f"x{number}_{k}"]
                self._add(
                    f"x{number}_{k}", x, y, edge, widths,
                    before and RoadLink("road", before, "end"),
                    after and RoadLink("road", after, "start"),
                )  # fmt: skip
        for x, gore, on in ((one.start, one.entering, True), (one.end, one.leaving, False)):
            if not gore:
                continue
            name = f"r{number}{'on' if on else 'off'}"
            if self._apart:
                a, b = links[name]
                before, after = a and RoadLink("road", a, "end"), b and RoadLink("road", b, "start")
            else:
                key = f"{1000 + round(x)}"
                here = next(f"m{k}" for k, piece in enumerate(pieces) if x == piece[0 if on else 1])
                if on:
                    self._connect(key, name, here, [(1, plan.lanes + 1)])
                else:
                    self._connect(key, here, name, [(plan.lanes + 1, 1)])
                link = RoadLink("junction", key, None)
                before, after = (None, link) if on else (link, None)
            turn = ANGLE if on else -ANGLE
            begin = (
                PlanPose(x - RAMP * np.cos(turn), edge - RAMP * np.sin(turn), turn)
                if on
                else PlanPose(x, edge, turn)
            )
            self._ramp(name, begin, before, after)

    def _ramp(
        self, name: str, begin: PlanPose, before: RoadLink | None, after: RoadLink | None
    ) -> None:
        self._road(name, begin, RAMP, [(0.0, {1: constant(WIDTH)})], before, after, self._plan.slow)

    def _add(
        self, name: str, start: float, end: float, y: float,
        sections: list[tuple[float, dict[int, tuple[Cubic, ...]]]], before: RoadLink | None,
        after: RoadLink | None,
    ) -> None:  # fmt: skip
        moved = [(x - start, widths) for x, widths in sections]
        begin = PlanPose(start, y, 0.0)
        self._road(name, begin, end - start, moved, before, after, self._plan.limit)

    def _road(
        self, name: str, begin: PlanPose, length: float,
        sections: list[tuple[float, dict[int, tuple[Cubic, ...]]]],
        before: RoadLink | None, after: RoadLink | None, limit: float,
    ) -> None:  # fmt: skip
        against = self._plan.against
        sections = sorted(sections, key=lambda one: one[0])
        ends = [one[0] for one in sections[1:]] + [length]
        made = []
        for index, ((s, widths), end) in enumerate(zip(sections, ends, strict=True)):
            lanes = {}
            for lane, width in widths.items():
                back = (index > 0 and lane in sections[index - 1][1]) or (
                    index == 0 and self._plain(before)
                )
                on = (index < len(ends) - 1 and lane in sections[index + 1][1]) or (
                    index == len(ends) - 1 and self._plain(after)
                )
                sign = 1 if against else -1
                links = (sign * lane if back else None, sign * lane if on else None)
                if against:
                    links, width = links[::-1], self._turned(width)
                lanes[sign * lane] = LaneDesign(
                    "driving", width, predecessor=links[0], successor=links[1]
                )
            made.append(SectionDesign(length - end if against else s, lanes))
        if against:
            begin = PlanPose(
                begin.x + length * np.cos(begin.heading),
                begin.y + length * np.sin(begin.heading),
                begin.heading + np.pi,
            )
            made.reverse()
            before, after = (self._other_end(link) for link in (after, before))
        kind = "motorway"
        self._roads.append(
            RoadDesign(name, name, begin, (line(length),), tuple(made), kind, limit,
                predecessor=before, successor=after)
        )  # fmt: skip

    def _other_end(self, link: RoadLink | None) -> RoadLink | None:
        if link is None or link.contact is None:
            return link
        return link._replace(contact="start" if link.contact == "end" else "end")

    def _plain(self, link: RoadLink | None) -> bool:
        return link is not None and link.element_type != "junction"

    def _turned(self, width: tuple[Cubic, ...]) -> tuple[Cubic, ...]:
        """A width seen from the other end: tapers are symmetrical."""
        if width == opening(WIDTH, TAPER):
            return closing(WIDTH, TAPER)
        return opening(WIDTH, TAPER) if width == closing(WIDTH, TAPER) else width


class Traffic(NamedTuple):
    """Simulated vehicles; whether each one's route begins on a ramp or ends on one."""

    moving: VehicleMotion
    departing: list[Departure]

    def entering(self) -> set[str]:
        """Names of vehicles whose route begins on a ramp."""
        return {str(k) for k in self._seen() if self.departing[k].start[0].startswith("r")}

    def leaving(self) -> set[str]:
        """Names of vehicles whose route ends on a ramp."""
        return {str(k) for k in self._seen() if self.departing[k].end[0].startswith("r")}

    def passing(self, plan: Motorway, among: set[str], entering: bool) -> set[str]:
        """Those of some vehicles that pass the border between through lanes and another lane or
        ramp in view, 3 s from its ends.
        """
        border = -plan.lanes * WIDTH
        found = set()
        for name in among:
            y = self.moving.y[self.moving.vehicle == int(name)]
            ends = y[[30, -31]] if len(y) > 61 else y[:1].repeat(2)
            if (ends[0] < border < ends[1]) if entering else (ends[1] < border < ends[0]):
                found.add(name)
        return found

    def _seen(self) -> list[int]:
        return sorted(set(self.moving.vehicle.tolist()))

    def recording(self, left: bool = False) -> Recording:
        """The recording, mirrored for left-hand traffic."""
        rows = self.moving
        tracks = []
        for number in self._seen():
            own = rows.vehicle == number
            vehicle = self.departing[number].vehicle
            tracks.append(_track(str(number), rows.where(own), vehicle.length, vehicle.width, left))
        return Recording(tracks, 1.0 / RATE, None)


def _track(name: str, rows: VehicleMotion, length: float, width: float, left: bool) -> Track:
    who = participant(name, "car", length, width)
    side = -1.0 if left else 1.0
    h = side * rows.h
    back = REAR_AXLE * length
    zero = np.zeros(len(h))
    columns = {
        "time": rows.frame / RATE, "x": rows.x - back * np.cos(h),
        "y": side * rows.y - back * np.sin(h), "z": zero, "h": h,
        "pitch": zero, "roll": zero, "speed": np.hypot(rows.vx, rows.vy),
        "acceleration": rows.ax * np.cos(rows.h) + rows.ay * np.sin(rows.h),
        "road_id": np.full(len(h), None, object),
        "lane_id": np.zeros(len(h), np.int64), "s": zero, "t": zero, "lane_offset": zero,
    }  # fmt: skip
    return Track(
        name,
        who.kind,
        "car",
        who.box,
        lambda: {key: values.copy() for key, values in columns.items()},
    )


def traffic(
    plan: Motorway,
    folder: Path,
    seconds: float = 60.0,
    seed: int = 0,
    main: float = 2400.0,
    ramp: float = 700.0,
) -> Traffic:
    """Drive traffic on the map of sections: through vehicles and such of the
    ramps, vehicles per hour.
    """
    plan = Motorway(plan.length, plan.lanes, plan.extras)
    path = plan.write("sections", folder)
    net = build(path)
    last = f"m{sum(road.startswith('m') for road in load(path).roads) - 1}"
    flows = [Flow(("m0", -1), (last, -1), main)]
    for number, one in enumerate(plan.extras):
        if one.entering:
            flows.append(Flow((f"r{number}on", -1), (last, -1), ramp))
        if one.leaving:
            flows.append(Flow(("m0", -1), (f"r{number}off", -1), ramp))
    rng = np.random.default_rng(seed)
    departing = departures(flows, MOTORWAY, 60.0 + seconds, rng)
    fronts = simulate(departing, net, 60.0, 60.0 + seconds, seed)
    return Traffic(motion(fronts, [one.vehicle.length for one in departing], RATE), departing)


def site(plan: Motorway, cutting: Cutting, folder: Path, left: bool = False) -> Site:
    """A site with the map in one cutting."""
    return site_at(plan.write(cutting, folder, left))


def events_of(place: Site, driven: Traffic, left: bool = False) -> list[LabelledEvent]:
    """Events of the traffic at the site."""
    return label(driven.recording(left), place, "ramps")
