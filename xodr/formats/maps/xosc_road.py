"""The command `xosc-road`: maps converted with the error measured, compared, described, shown, cut,
placed, joined, repaired, driven on.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from schemas.common.errors import ExitCode, UsageError, exit_codes
from schemas.common.policy import scratch
from schemas.common.terminal.command_line import (
    Overwrite,
    Verbose,
    Version,
    epilog,
    guarded,
    new_app,
    protected,
    say,
)
from schemas.common.terminal.files import complete_road, named_road
from schemas.common.terminal.options import WRITTEN
from schemas.common.terminal.text import many

if TYPE_CHECKING:
    from xodr.formats.maps.comparing import MapDifference
    from xodr.formats.maps.lane_map import LaneMap

NAME = "xosc-road"
_EXAMPLES = (
    "xosc-road convert xodr/library/roundabout.xodr --out roundabout.osm --within 0.05",
    "xosc-road info xodr/library/roundabout.xodr",
)
_MOST_PLACES = 12
"""Roads or lanes that a line of `info` names"""
_EPILOG = exit_codes("done", "the error is beyond --within, or a test drive fails") + (
    " Formats: OpenDRIVE (.xodr), Lanelet2 (.osm), SUMO (.net.xml), CommonRoad (.xml), GeoJSON "
    "(.geojson), and"
    " OpenStreetMap (.osm) to read."
)
Source = Annotated[
    Path,
    typer.Argument(
        metavar="MAP",
        callback=named_road,
        autocompletion=complete_road,
        help="The map, or the name of a shipped road; its format is found by name and content.",
    ),
]
Origin = Annotated[
    str | None,
    typer.Option(
        metavar="LAT,LON", help="Origin (degrees) of the UTM coordinates of a Lanelet2 map."
    ),
]
Revision = Annotated[
    str | None,
    typer.Option(metavar="VERSION", help="Version of OpenDRIVE to write: 1.4 to 1.9."),
]
OutFile = Annotated[
    Path, WRITTEN, typer.Option(metavar="FILE", help="File to write; its name says the format.")
]
RoadOut = Annotated[
    Path, WRITTEN, typer.Option(metavar="FILE", help="The OpenDRIVE file to write.")
]
Page = Annotated[
    Path | None,
    WRITTEN,
    typer.Option(metavar="FILE", help="Write a page that draws both maps over each other."),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Within = Annotated[
    float | None,
    typer.Option(
        min=0.0, metavar="M",
        help="Fail if a border is farther away than this (m), or a lane or "
             "connection is lost or gained.",
    ),
]  # fmt: skip


def _named(paths: list[Path]) -> list[Path]:
    return list(map(named_road, paths))


app = new_app(NAME)


@app.callback(epilog=epilog(_EPILOG, *_EXAMPLES))
def xosc_road(_verbose: Verbose = False, _version: Version = False) -> None:
    """Convert, compare, describe, show, cut, place, join, repair and drive on
    maps; each command has --help.
    """


def _origin(text: str | None) -> tuple[float, float] | None:
    return (
        (_numbers(text, 2, "an origin is LAT,LON in degrees")[0], _numbers(text, 2, "")[1])
        if text is not None
        else None
    )


def _numbers(text: str, count: int, form: str) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != count:
        raise UsageError(f"{text!r} is wrong: {form}")
    return numbers


@app.command("convert")
@protected("max_runs")
def convert_command(
    path: Source,
    out: OutFile,
    origin: Origin = None,
    revision: Revision = None,
    within: Within = None,
    page: Page = None,
    as_json: Json = False,
    overwrite: Overwrite = False,
    _verbose: Verbose = False,
) -> None:
    """Convert a map, read the result back, and print what became of its lanes."""
    from xodr.formats.maps.files import convert

    made = convert(path, out, origin=_origin(origin), revision=revision, overwrite=overwrite)
    if page is not None:
        _write_page(made.source, page, made.result, made.difference)
    _tell(
        made.difference,
        as_json,
        [f"{made.source_format} to {made.target_format}: {made.path}"],
        made.notes,
    )
    raise typer.Exit(_verdict(made.difference, within))


@app.command("compare")
@protected("max_runs")
def compare_command(
    path: Source,
    against: Annotated[
        Path,
        typer.Argument(
            metavar="OTHER", callback=named_road, help="The map that it is compared with."
        ),
    ],
    origin: Origin = None,
    within: Within = None,
    page: Page = None,
    as_json: Json = False,
    _verbose: Verbose = False,
) -> None:
    """Compare two maps of one place: geometry, lanes, links, types, limits."""
    from xodr.formats.maps.files import compare, read_map

    difference = compare(path, against, origin=_origin(origin))
    if page is not None:
        _write_page(read_map(path), page, read_map(against), difference)
    _tell(difference, as_json, [f"{path} and {against}"], [])
    raise typer.Exit(_verdict(difference, within))


@app.command("info")
@protected("max_runs")
def info_command(
    path: Source, origin: Origin = None, as_json: Json = False, _verbose: Verbose = False
) -> None:
    """Print length of lanes by type, junctions, signals, bounds and projection of a map."""
    from xodr.formats.maps.files import info

    about = info(path, origin=_origin(origin))
    if as_json:
        say(json.dumps(about.as_json(), ensure_ascii=False))
        return
    west, south, east, north = about.bounds
    places = "lanes" if about.roads is None else "roads"
    roads = (
        [f"roads {about.roads}", f"junctions {about.junctions}"] if about.roads is not None else []
    )
    say(
        f"{path}: {about.format}",
        ", ".join(
            [
                *roads,
                f"lanes {about.lanes}",
                *(f"{kind}s {count}" for kind, count in about.signals.items()),
            ]
        ),
        *(f"  {kind:16} {length / 1000.0:10.3f} km" for kind, length in about.lengths.items()),
        "objects: " + (", ".join(f"{kind} {n}" for kind, n in about.furniture.items()) or "none"),
        "speed limits:",
        *(
            f"  {limit if limit == 'none' else f'{limit} km/h':16} {length / 1000.0:10.3f} km: "
            f"{places} {_some(about.limited[limit])}"
            for limit, length in about.limits.items()
        ),
        f"bounds: x {west:.2f} to {east:.2f} m, y {south:.2f} to {north:.2f} m, z "
        f"{about.heights[0]:.2f} to {about.heights[1]:.2f} m",
        f"traffic keeps to the {'left' if about.left_hand else 'right'}",
        f"projection: {about.projection or 'none'}",
        *(
            [f"offset: {', '.join(f'{part:.10g}' for part in about.offset)}"]
            if about.projection
            else []
        ),
        *(
            [f"south-western corner: {about.corner[0]:.7f}, {about.corner[1]:.7f}"]
            if about.corner is not None
            else []
        ),
        *(f"remark: {note}" for note in about.notes),
    )


def _some(names: Sequence[str]) -> str:
    rest = len(names) - _MOST_PLACES
    more = f" and {rest} others, as --json lists them" if rest > 0 else ""
    return f"{', '.join(names[:_MOST_PLACES])}{more}"


@app.command("show")
@protected("max_runs")
def show_command(
    path: Source,
    out: Annotated[
        Path,
        WRITTEN,
        typer.Option(
            metavar="FILE",
            help="File to write: .html for a page, .png, .svg or .pdf for a picture.",
        ),
    ],
    origin: Origin = None,
    overwrite: Overwrite = False,
    _verbose: Verbose = False,
) -> None:
    """Draw a map: lanes by type, directions, connections, signals, and what
    xosc-check finds in an OpenDRIVE file.
    """
    from xodr.formats.maps.files import faults, format_of, read_map

    if out.exists() and not overwrite:
        raise UsageError("a file is in the way; --overwrite replaces it", path=out)
    kind = format_of(path)
    made = read_map(path, _origin(origin), kind)
    found, elsewhere = faults(path) if kind == "opendrive" else ([], [])
    if out.suffix.lower() in (".html", ".htm"):
        from schemas.common.storage import keep, writing
        from xodr.formats.maps.page import write_page

        with writing("the page", out):
            keep(write_page(made, found, None, elsewhere), out)
    elif out.suffix.lower() in (".png", ".svg", ".pdf"):
        from schemas.common.storage import drafted, writing
        from xodr.formats.maps.page import write_picture

        with writing("the picture", out), drafted(out) as draft:
            write_picture(made, str(draft), found)
    else:
        raise UsageError("a page ends in .html, a picture in .png, .svg or .pdf", path=out)
    say(f"{len(made.lanes)} lanes: {out}")


@app.command("cut")
@protected("max_runs")
def cut_command(
    path: Source,
    out: RoadOut,
    box: Annotated[
        str | None, typer.Option(metavar="W,S,E,N", help="Keep roads that touch this box (m).")
    ] = None,
    polygon: Annotated[
        str | None,
        typer.Option(metavar="'X,Y X,Y X,Y'", help="Keep roads that touch this area (m)."),
    ] = None,
    roads: Annotated[
        str | None,
        typer.Option(
            metavar="ID,ID", help="Keep these roads, and the ways through junctions between them."
        ),
    ] = None,
    route: Annotated[
        str | None,
        typer.Option(metavar="ID,ID", help="Keep the roads of the shortest way over these roads."),
    ] = None,
    overwrite: Overwrite = False,
    _verbose: Verbose = False,
) -> None:
    """Cut whole roads out of an OpenDRIVE map; links to what is left out are closed."""
    from xodr.formats.maps.files import cut_roads

    area, four = None, None
    if polygon is not None:
        corners = [_numbers(corner, 2, "a corner is X,Y in m") for corner in polygon.split()]
        area = [(x, y) for x, y in corners]
    if box is not None:
        west, south, east, north = _numbers(box, 4, "a box is WEST,SOUTH,EAST,NORTH in m")
        four = (west, south, east, north)
    content, notes = cut_roads(path, box=four, polygon=area, roads=_ids(roads), route=_ids(route))
    _keep(content, out, overwrite)
    say(f"{out}", *(f"remark: {note}" for note in notes))


def _ids(text: str | None) -> list[str] | None:
    return text.split(",") if text is not None else None


@app.command("place")
@protected("max_runs")
def place_command(
    path: Source,
    out: RoadOut,
    move: Annotated[
        str, typer.Option(metavar="X,Y,Z", help="Move by this (m), after a turn.")
    ] = "0,0,0",
    turn: Annotated[float, typer.Option(metavar="DEG", help="Turn by this angle (degrees).")] = 0.0,
    about: Annotated[str, typer.Option(metavar="X,Y", help="Turn about this place (m).")] = "0,0",
    projection: Annotated[
        str | None, typer.Option(metavar="PROJ", help="Name this projection, by another offset.")
    ] = None,
    without_offset: Annotated[
        bool,
        typer.Option("--without-offset", help="Make the header's offset part of the coordinates."),
    ] = False,
    elsewhere: Annotated[
        bool,
        typer.Option(
            "--elsewhere", help="Keep projection and offset: the map lies elsewhere on earth."
        ),
    ] = False,
    overwrite: Overwrite = False,
    _verbose: Verbose = False,
) -> None:
    """Move, turn or re-project an OpenDRIVE map; it stays where it is on earth."""
    from math import radians

    from xodr.formats.maps.files import place_map

    x, y, z = _numbers(move, 3, "a move is X,Y,Z in m")
    px, py = _numbers(about, 2, "a place is X,Y in m")
    content, notes = place_map(
        path,
        move=(x, y, z),
        turn=radians(turn),
        about=(px, py),
        projection=projection,
        without_offset=without_offset,
        elsewhere=elsewhere,
    )
    _keep(content, out, overwrite)
    say(f"{out}", *(f"remark: {note}" for note in notes))


@app.command("join")
@protected("max_runs")
def join_command(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="MAP...",
            callback=_named,
            help="OpenDRIVE files; the first keeps its ids and coordinates.",
        ),
    ],
    out: RoadOut,
    meet: Annotated[
        float,
        typer.Option(
            "--meet",
            min=0.0,
            metavar="M",
            help="Link open ends whose lane borders are this near (m).",
        ),
    ] = 0.05,
    overwrite: Overwrite = False,
    _verbose: Verbose = False,
) -> None:
    """Join OpenDRIVE maps to one; open ends that meet are linked."""
    from xodr.formats.maps.files import join_maps

    content, notes = join_maps(paths, within=meet)
    _keep(content, out, overwrite)
    say(f"{out}", *(f"remark: {note}" for note in notes))


@app.command("repair")
@protected("max_runs")
def repair_command(
    path: Source,
    out: RoadOut,
    overwrite: Overwrite = False,
    _verbose: Verbose = False,
) -> None:
    """Write an OpenDRIVE file without the faults that have one sensible mend;
    each mend is a remark.
    """
    from schemas import check
    from xodr.formats.maps.files import repair

    made = repair(path)
    _keep(made.content, out, overwrite)
    left = sum(problem.level == "error" for problem in check(out))
    say(
        f"{out}: {many(len(made.remarks), 'kind')} of faults mended",
        *(f"remark: {remark}" for remark in made.remarks),
    )
    if left:
        say(f"{many(left, 'error')} without one sensible mend left: xosc-check {out}")


@app.command("drive")
@protected("max_runs")
def drive_command(path: Source, as_json: Json = False, _verbose: Verbose = False) -> None:
    """Drive over each connection of a map with SUMO, a vehicle each, and print those that fail."""
    from xodr.formats.maps.files import convert, drive_connections, format_of, read_map

    if format_of(path) == "sumo":
        # SUMO drives on lanes whose places are no numbers, by their lengths.
        read_map(path)
        drives = drive_connections(path)
    else:
        with scratch("xosc-road-") as folder:
            drives = drive_connections(convert(path, folder / "map.net.xml").path)
    failed = [drive for drive in drives if drive.problem]
    if as_json:
        say(json.dumps([drive._asdict() for drive in drives], ensure_ascii=False))
    else:
        say(f"{len(drives)} connections driven, {len(failed)} failed")
        say(*(f"  {drive.source} to {drive.target}: {drive.problem}" for drive in failed))
    raise typer.Exit(ExitCode.FINDING if failed else ExitCode.PASSED)


def _keep(content: bytes, out: Path, overwrite: bool) -> None:
    from schemas.common.storage import keep, writing

    if out.exists() and not overwrite:
        raise UsageError("a file is in the way; --overwrite replaces it", path=out)
    with writing("the map", out):
        keep(content, out)


def _write_page(one: LaneMap, page: Path, other: LaneMap, difference: MapDifference) -> None:
    from schemas.common.storage import keep, writing
    from xodr.formats.maps.page import MapFinding, write_page

    worst = [
        MapFinding(x, y, f"border {away:.3f} m off")
        for x, y, away in difference.worst
        if away > 0.01
    ]
    with writing("the page", page):
        keep(write_page(one, worst, other, list(_table(difference))), page)


def _table(difference: MapDifference) -> Iterable[str]:
    """Lines that say how two maps differ."""
    yield f"{'':14}{'median':>10}{'95 %':>10}{'largest':>10}  (m)"
    rows = (
        ("borders", difference.borders),
        ("centre lines", difference.centres),
        ("heights", difference.heights),
    )
    for name, row in rows:
        where = f"  {row.where}" if row.largest > 0.001 else ""
        yield f"{name:14}{row.median:10.4f}{row.most:10.4f}{row.largest:10.4f}{where}"
    yield (
        f"within 5 cm at both borders: {difference.within:.2%} of "
        f"{difference.length / 1000.0:.3f} km of lanes"
    )
    for name, lanes in (("lost", difference.lost), ("gained", difference.gained)):
        some = ", ".join(f"{lane} ({length:.0f} m)" for lane, length in list(lanes.items())[:5])
        yield (
            f"lanes {name}: {len(lanes)}, {sum(lanes.values()):.0f} m{': ' + some if some else ''}"
        )
    yield (
        f"connections: {difference.connections}, lost {len(difference.connections_lost)},"
        f" gained {len(difference.connections_gained)}"
    )
    for source, target in difference.connections_lost[:5]:
        yield f"  lost: {source} to {target}"
    for source, target in difference.connections_gained[:5]:
        yield f"  gained: {source} to {target}"
    if difference.types:
        yield f"other types: {len(difference.types)} lanes, e.g. {' '.join(difference.types[0])}"
    if difference.limits:
        lane, here, there = difference.limits[0]
        yield (
            f"other speed limits: {len(difference.limits)} lanes, e.g. {lane}: {_speed(here)}, "
            f"{_speed(there)}"
        )


def _speed(limit: float | None) -> str:
    return "none" if limit is None else f"{limit * 3.6:.0f} km/h"


def _tell(difference: MapDifference, as_json: bool, head: list[str], notes: list[str]) -> None:
    if as_json:
        from dataclasses import asdict

        say(json.dumps({**asdict(difference), "notes": notes}, ensure_ascii=False, default=list))
        return
    say(*head, *_table(difference), *(f"remark: {note}" for note in notes))


def _verdict(difference: MapDifference, within: float | None) -> int:
    """The exit code by a limit (m); None for no limit."""
    if within is None:
        return ExitCode.PASSED
    reasons = []
    if difference.borders.largest > within:
        reasons.append(f"a border is {difference.borders.largest:.3f} m off")
    if difference.lost or difference.gained:
        reasons.append(f"{len(difference.lost)} lanes lost, {len(difference.gained)} gained")
    if difference.connections_lost or difference.connections_gained:
        reasons.append(
            f"{len(difference.connections_lost)} connections lost, "
            f"{len(difference.connections_gained)} gained"
        )
    if reasons:
        say(f"{NAME}: beyond --within {within:g}: {'; '.join(reasons)}", to=sys.stderr)
    return ExitCode.FINDING if reasons else ExitCode.PASSED


def main() -> None:
    """Entry point."""
    guarded(NAME, partial(app, prog_name=NAME))


if __name__ == "__main__":
    main()
