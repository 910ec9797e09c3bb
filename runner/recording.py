"""Recordings of runs and of real traffic: states of entities over time, and the event log."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from struct import Struct
from typing import TYPE_CHECKING, NamedTuple, TypeVar

if TYPE_CHECKING:
    import numpy as np
    import pyarrow as pa

    from runner.engine.participants.declaration import BoundingBox, Declaration
    from runner.engine.participants.entity import Entities, Entity
    from xodr.graph.network import RoadNetwork
    from xodr.model import RoadPoint

COLUMNS = (
    "time",
    "x",
    "y",
    "z",
    "h",
    "pitch",
    "roll",
    "speed",
    "acceleration",
    "road_id",
    "lane_id",
    "s",
    "t",
    "lane_offset",
)
"""Columns of a track: s; m in the world frame of the road network (reference point); rad,
mathematical; m/s and m/s² along the heading; OpenDRIVE road coordinates (lane_offset is t minus the
t of the lane's centre)."""

_PLACE = ("road_id", "lane_id", "s", "t", "lane_offset")


@dataclass(eq=False)
class Track:
    """One participant of a recording.

    Args:
        name: its name.
        kind: vehicle, pedestrian or miscellaneous.
        category: e.g. car, truck, bicycle.
        box: its bounding box about the reference point, m.
        read: gives one array for each of `COLUMNS`, in ascending time; called once, when they are
            asked for.
        mass: kg; 0 where it is not known.
        role: e.g. ambulance, civil; empty where it is not known.
        front_axle: x of the front axle in the own frame, m; 0 where it is not known.
    """

    name: str
    kind: str
    category: str
    box: BoundingBox
    read: Callable[[], dict[str, np.ndarray]]
    mass: float = 0.0
    role: str = ""
    front_axle: float = 0.0

    @cached_property
    def columns(self) -> dict[str, np.ndarray]:
        """One array for each of `COLUMNS`; a road id of None means that the place on the road was
        not looked up yet."""
        return self.read()

    def locate(self, network: RoadNetwork) -> None:
        """Look up the places on the road that are missing."""
        columns = self.columns
        x, y, z, h = (columns[name] for name in ("x", "y", "z", "h"))
        hint: RoadPoint | None = None
        for i, road_id in enumerate(columns["road_id"]):
            if road_id is None:
                hint = network.locate(float(x[i]), float(y[i]), float(z[i]), float(h[i]), hint)
                place = (hint.road_id, hint.lane_id, hint.s, hint.t, hint.offset)
                for name, value in zip(_PLACE, place, strict=True):
                    columns[name][i] = value


class Recording:
    """Tracks of all participants on one road network.

    Args:
        tracks: one for each participant.
        timestep: time between rows, s.
        network: the roads, for looking up road coordinates that the run had no need of.

    Example:
        >>> import xosc_toolchain as xt
        >>> result = xt.run("xosc/library/simple_cut_in.xosc", world="kinematic", max_time=1.0)
        >>> recording = result.recording
        >>> sorted(recording.tracks)
        ['CutIn', 'Ego']
    """

    def __init__(self, tracks: list[Track], timestep: float, network: RoadNetwork | None) -> None:
        self.tracks = {track.name: track for track in tracks}
        self.timestep = timestep
        self.network = network
        self._located = False

    def locate(self) -> Recording:
        """Complete the road coordinates of every row (done once, on demand)."""
        if not self._located and self.network is not None:
            for track in self.tracks.values():
                track.locate(self.network)
        self._located = True
        return self

    def table(self) -> pa.Table:
        """Long form, sorted by time, then by the participants' order; `entity` after `time`, then
        the other columns."""
        import numpy as np
        import pyarrow as pa

        self.locate()
        tracks = list(self.tracks.values())
        if not tracks:
            return pa.table(
                {name: pa.array([], arrow_type(name)) for name in ("time", "entity", *COLUMNS[1:])}
            )
        time = np.concatenate([track.columns["time"] for track in tracks])
        order = np.argsort(time, kind="stable")
        names = np.repeat(np.arange(len(tracks)), [len(track.columns["time"]) for track in tracks])[
            order
        ]
        entity = pa.DictionaryArray.from_arrays(
            names.astype(np.int32), [track.name for track in tracks]
        ).cast(pa.string())
        table = {"time": pa.array(time[order]), "entity": entity}
        for name in COLUMNS[1:]:
            joined = np.concatenate([track.columns[name] for track in tracks])[order]
            table[name] = pa.array(joined, arrow_type(name))
        return pa.table(table)


def arrow_type(name: str) -> pa.DataType:
    """The type of a column of the long form."""
    import pyarrow as pa

    return {"entity": pa.string(), "road_id": pa.string(), "lane_id": pa.int64()}.get(
        name, pa.float64()
    )


_FIELDS = [
    (name, "int64" if name == "lane_id" else "float64") for name in COLUMNS if name != "road_id"
]
_ROW = Struct("=" + "".join("q" if type_ == "int64" else "d" for _, type_ in _FIELDS))
"""The numbers of `COLUMNS` at one instant as bytes: objects for each row would keep Python's
garbage collector busy."""
_pack = _ROW.pack


class _EntityRecord:
    """Recorded rows of one entity; a road id of None is not looked up yet."""

    __slots__ = ("numbers", "roads")

    def __init__(self) -> None:
        self.numbers = bytearray()
        self.roads: list[str | None] = []

    def columns(self) -> dict[str, np.ndarray]:
        """One array for each of `COLUMNS`."""
        import numpy as np

        rows = np.frombuffer(bytes(self.numbers), dtype=_FIELDS)
        return {
            name: rows[name].copy() if name != "road_id" else np.array(self.roads, dtype=object)
            for name in COLUMNS
        }


def _track(declared: Declaration, rows: _EntityRecord) -> Track:
    named = (declared.name, declared.kind, declared.category, declared.box)
    return Track(*named, rows.columns, declared.mass, declared.role, declared.front_axle)


class Recorder:
    """Writes down every present entity of a run, once a step.

    Args:
        entities: everyone.
        timestep: time between rows, s.
        network: the roads.
    """

    def __init__(self, entities: Entities, timestep: float, network: RoadNetwork | None) -> None:
        self._entities, self._timestep, self._network = entities, timestep, network
        self._rows: dict[Entity, _EntityRecord] = {}

    def correct(self, time: float, entities: Iterable[Entity]) -> None:
        """Write down the state of some anew, in the place of their rows of the same time (s)."""
        changed = dict.fromkeys(entities)
        for entity in changed:
            written = self._rows.get(entity)
            if written is not None and _ROW.unpack_from(written.numbers, -_ROW.size)[0] == time:
                del written.numbers[-_ROW.size :], written.roads[-1]
        self.record(time, changed)

    def record(self, time: float, entities: Iterable[Entity] | None = None) -> None:
        """Write down the state of everyone, or of some, at a time (s)."""
        rows, pack = self._rows, _pack
        for e in self._entities.values() if entities is None else entities:
            if not (e.active and e.placed):
                continue
            written = rows.get(e)
            if written is None:
                written = rows[e] = _EntityRecord()
            road = e.road if e.on_lane else None
            if road is not None:
                lane, offset = e.kept_lane, e.kept_offset
                if offset:  # on the centre of its lane, as nearly always, it is in that lane
                    lane, offset = e.lane_below()
                written.roads.append(road.id)
                written.numbers += pack(
                    time,
                    e.x,
                    e.y,
                    e.z,
                    e.h,
                    e.pitch,
                    e.roll,
                    e.speed,
                    e.acceleration,
                    lane,
                    e.s,
                    e.t,
                    offset,
                )
            else:
                written.roads.append(None)
                written.numbers += pack(
                    time,
                    e.x,
                    e.y,
                    e.z,
                    e.h,
                    e.pitch,
                    e.roll,
                    e.speed,
                    e.acceleration,
                    0,
                    0.0,
                    0.0,
                    0.0,
                )

    def recording(self) -> Recording:
        """Return the recording so far."""
        tracks = [_track(entity.declared, rows) for entity, rows in self._rows.items()]
        return Recording(tracks, self._timestep, self._network)


class LogEntry(NamedTuple):
    """One line of the event log: when (s), what kind of event, which element or entity, and why."""

    time: float
    kind: str
    subject: str
    text: str


def signal_states(events: Iterable[LogEntry]) -> dict[str, list[tuple[float, str]]]:
    """Changes of each signal by its id: time (s) and new state, in the scenario's words."""
    return _changes(events, "trafficSignal", lambda text: text)


def light_states(events: Iterable[LogEntry]) -> dict[str, list[tuple[float, tuple[str, str]]]]:
    """Changes of the lights of each entity by its name: time (s), light and new mode (on, off,
    flashing)."""

    def parted(text: str) -> tuple[str, str]:
        light, _, mode = text.rpartition(" ")
        return light, mode

    return _changes(events, "light", parted)


_State = TypeVar("_State")


def _changes(
    events: Iterable[LogEntry], kind: str, state: Callable[[str], _State]
) -> dict[str, list[tuple[float, _State]]]:
    changes: dict[str, list[tuple[float, _State]]] = {}
    for entry in events:
        if entry.kind == kind:
            changes.setdefault(entry.subject, []).append((entry.time, state(entry.text)))
    return changes
