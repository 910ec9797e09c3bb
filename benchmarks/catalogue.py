"""Time to make a catalogue of a recording of highD's size (17 minutes, 1,000 vehicles).

    python benchmarks/catalogue.py [--recording FOLDER] [--seconds 1020] [--labels auto|rules]
    [--jobs N] [--parts]
    python benchmarks/catalogue.py --page CATALOGUE [--scenarios 5000]

The recording is made first, by the recorder in highD's format, unless the folder has it; only what
comes after is timed, in seconds and in seconds of processors, which tell more where others work on
the machine. Then what took most of the time is compared with the plain ways: measuring all others
of a scene at once with one after the other, and catalogues of trajectories as text with documents
of scenariogeneration's objects. With --parts the catalogue is made in this process instead, and
what each part took of the processor is printed; so are the bytes of a recorded hour.

With --page the scenarios of a catalogue are repeated to that number on one page, and headless
Chromium measures how long it takes to show the page and to answer a filter and an order.
"""

from __future__ import annotations

import argparse
import functools
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from scenariogeneration import xosc as sg

from recognition import recordings as datasets
from recognition.catalogue import pipeline
from recognition.catalogue.detect import ByRules
from recognition.catalogue.model import ByModel, load
from recognition.catalogue.pipeline import SHIPPED, build
from recognition.catalogue.recordings import CatalogueSettings
from recognition.catalogue.writing import index, write
from recognition.catalogue.writing.replay import trajectories
from recognition.catalogue.writing.write import CatalogWriter
from recognition.recorder.recorder import record_one
from recognition.recorder.sites import SITES
from recognition.scenes import site_of
from recognition.scenes.cut import Excerpt, Part, SceneCutter, Scope
from runner.judging.measures.criticality import criticality
from runner.judging.measures.relations import MotionRows
from schemas.common.terminal.command_line import progress_bar
from xosc.document import to_bytes
from xosc.writing import maneuvers
from xosc.writing.maneuvers import world_position

_LENGTH = 17.0 * 60.0
_TRAFFIC = 0.75
"""Of the traffic of the site with two lanes: a thousand vehicles in this time"""
_SCENES, _SCENE = 20, 12.0
"""Scenes that are compared, and their length, s"""
_HEADER = maneuvers.FileHeader("trajectories", "benchmark", datetime(2000, 1, 1))


def main() -> None:
    """Print times."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("--recording", type=Path, help="folder of the recording")
    arguments.add_argument(
        "--seconds", type=float, default=_LENGTH, help="length of the recording that is made"
    )
    arguments.add_argument("--labels", choices=("auto", "rules"), default="auto")
    arguments.add_argument("--jobs", type=int, default=2, help="processes of the command")
    arguments.add_argument(
        "--parts", action="store_true", help="in this process instead, with the time of each part"
    )
    arguments.add_argument(
        "--page", type=Path, metavar="CATALOGUE", help="measure the page of this catalogue instead"
    )
    arguments.add_argument("--scenarios", type=int, default=5000, help="scenarios of the page")
    options = arguments.parse_args()
    if options.page:
        with tempfile.TemporaryDirectory() as scratch:
            show(options.page, options.scenarios, Path(scratch))
        return
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.recording or Path(scratch) / "recording"
        if not folder.exists():
            site = SITES["motorway_two_lanes"]
            flows = tuple(flow._replace(rate=_TRAFFIC * flow.rate) for flow in site.flows)
            record_one(replace(site, flows=flows), folder, options.seconds)
        out = Path(scratch) / "catalogue"
        if options.parts:
            in_parts(folder, out, options.labels)
            return
        start = time.perf_counter()
        command = [
            sys.executable,
            "-m",
            "recognition.xosc_recognize",
            str(folder),
            "--labels",
            options.labels,
        ]
        subprocess.run([*command, "--out", str(out), "--jobs", str(options.jobs)], check=True)
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        took, processors = time.perf_counter() - start, used.ru_utime + used.ru_stime
        count = len(json.loads((out / "index.json").read_text())["scenarios"])
        print(
            f"{count} scenarios: {took:.1f} s with {options.jobs} jobs, "
            f"{processors:.1f} s of processors"
        )
        compare(folder, Path(scratch))


def in_parts(folder: Path, out: Path, labels: str) -> None:
    """Make the catalogue in this process, and print what its parts took of the processor."""
    taken = dict.fromkeys(
        (
            "reading and smoothing",
            "rules",
            "model",
            "cutting scenes",
            "measuring scenes",
            "writing",
        ),
        0.0,
    )
    taken |= dict.fromkeys(("films", "lanes of the page", "page", "exposure"), 0.0)
    places: list[tuple[object, str]] = [
        (datasets.Source, "load"), (pipeline, "label"), (ByModel, "look"), (SceneCutter, "cut"),
        (write, "criticality_of"),
        (CatalogWriter, "add"), (write, "film"), (index, "lanes"), (index, "catalogue_page"),
        (pipeline, "exposure_of"),
    ]  # fmt: skip
    for part, (owner, name) in zip(taken, places, strict=True):
        setattr(owner, name, _timed(getattr(owner, name), part, taken))
    start = time.process_time()
    recogniser = ByRules() if labels == "rules" else load(SHIPPED)
    loading = time.process_time() - start
    summary = build(
        [folder],
        out,
        CatalogueSettings(),
        lambda: recogniser,
        functools.partial(progress_bar, quiet=True),
    )
    whole, count = time.process_time() - start, sum(summary.classes.values())
    taken["writing"] -= taken["cutting scenes"] + taken["measuring scenes"] + taken["films"]
    print(
        f"{count} scenarios: {whole:.1f} s of processors, {1e3 * taken['writing'] / count:.1f} ms "
        "to write one"
    )
    for part, seconds in (
        {"reading the model": loading} | taken | {"rest": whole - loading - sum(taken.values())}
    ).items():
        print(f"{part:<22}{seconds:6.1f} s {seconds / whole:4.0%}")
    size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
    hours = sum(_duration(source) for source in datasets.open(folder).sources) / 3600.0
    print(f"{size / 1e6:.1f} MB, {size / 1e6 / hours:.0f} MB for a recorded hour")


def _duration(source: datasets.Source) -> float:
    """Time from the first to the last row of a recording, s."""
    times = [track.columns["time"] for track in source.load().tracks.values()]
    return float(max(time[-1] for time in times) - min(time[0] for time in times))


def show(catalogue: Path, count: int, scratch: Path) -> None:
    """Print how long a page of many scenarios takes to load, to filter and to
    sort, and its size.
    """
    from tests.runner.chromium import Browser

    head, mark, rest = (
        (catalogue / "index.html")
        .read_text()
        .partition('<script type="application/json" id="data">')
    )
    text, end, rest = rest.partition("</script>")
    data = json.loads(text)
    rows = [row % len(data["films"]) for row in range(count)]
    for name in ("coded", "texts", "measures"):
        data[name] = {key: [values[row] for row in rows] for key, values in data[name].items()}
    for name in ("partial", "films"):
        data[name] = [data[name][row] for row in rows]
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=False).replace("<", "\\u003c")
    path = scratch / "page.html"
    path.write_text(f"{head}{mark}{text}{end}{rest}", encoding="utf-8")
    print(f"{count} scenarios: {path.stat().st_size / 1e6:.1f} MB")
    with Browser(scratch / "profile") as browser:
        for width in (1400, 390):
            browser.open(path, width=width)
            shown = browser.run("performance.now()")
            change = (
                "const all = document.getElementById('choose-{0}'); all.value = '{1}'; "
                "all.dispatchEvent(new Event('change'))"
            )
            times = [
                browser.run(f"(() => {{ const start = performance.now(); {change.format(*each)}; "
                            "document.body.offsetHeight; "
                            "return performance.now() - start; })()")
                for each in (("class", data["names"]["class"][0]), ("class", ""), ("sort", "-gap"))
            ]  # fmt: skip
            told = ", ".join(
                f"{name} {took:.0f} ms"
                for name, took in zip(("filter", "all", "order"), times, strict=True)
            )
            print(f"{width} px: shown within {shown:.0f} ms, {told}; errors: {browser.errors}")


def _timed(
    work: Callable[..., object], part: str, taken: dict[str, float]
) -> Callable[..., object]:
    """The same work, with the processor time that it takes added to what the part has taken."""

    @functools.wraps(work)
    def timed(*arguments: object, **named: object) -> object:
        start = time.process_time()
        try:
            return work(*arguments, **named)
        finally:
            taken[part] += time.process_time() - start

    return timed


def compare(folder: Path, scratch: Path) -> None:
    """Print how much faster measuring and trajectories are than the plain ways, on scenes of the
    recording."""
    (source, *_) = datasets.open(folder).sources
    recording = source.load()
    site_of(source, recording, scratch)
    cutter, egos = (
        SceneCutter(recording, Scope()),
        list(recording.tracks.values())[:: max(1, len(recording.tracks) // _SCENES)],
    )
    scenes = [
        cutter.cut(ego.name, ego.columns["time"][0], ego.columns["time"][0] + _SCENE)
        for ego in egos
    ]
    motions = [[_motion(part, scene) for part in scene.parts] for scene in scenes]
    together = _seconds(lambda: [criticality(ego, others).summary for ego, *others in motions])
    alone = _seconds(
        lambda: [criticality(ego, [other]).summary for ego, *others in motions for other in others]
    )
    print(
        f"measuring {len(scenes)} scenes: {together:.2f} s, one by one {alone:.2f} s: "
        f"{alone / together:.1f} times as long"
    )
    text = _seconds(
        lambda: [maneuvers.trajectory_catalog(_HEADER, trajectories(scene)) for scene in scenes]
    )
    objects = _seconds(
        lambda: [_document([_objects(part, scene) for part in scene.parts]) for scene in scenes]
    )
    print(
        f"their trajectories: {text:.2f} s, of objects {objects:.2f} s: {objects / text:.1f} "
        "times as long"
    )


def _motion(part: Part, scene: Excerpt) -> MotionRows:
    columns = part.track.columns
    inside = (columns["time"] >= scene.start) & (columns["time"] <= scene.end)
    return MotionRows.from_columns(
        part.name, part.track.box, {name: values[inside] for name, values in columns.items()}
    )


def _objects(part: Part, scene: Excerpt) -> sg.Trajectory:
    """A trajectory as scenariogeneration builds it."""
    places = zip(*(part.column(name).tolist() for name in ("x", "y", "h")), strict=True)
    built = sg.Trajectory(part.name, False)
    built.add_shape(
        sg.Polyline(
            (part.time - scene.start).tolist(), [world_position(x, y, h=h) for x, y, h in places]
        )
    )
    return built


def _document(paths: list[sg.Trajectory]) -> bytes:
    return to_bytes(maneuvers.catalog("c.xosc", _HEADER, "TrajectoryCatalog", paths))


def _seconds(work: Callable[[], object]) -> float:
    """Processor time of the fastest of three."""
    times = []
    for _ in range(3):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


if __name__ == "__main__":
    main()
