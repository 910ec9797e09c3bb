"""Kinds of fuzzed input: what is changed, which command or reader gets it, and
the exit codes that it may lead to.
"""

from __future__ import annotations

import io
import json
import shutil
import sys
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from random import Random
from typing import NamedTuple

from tests.commands import Answer, main
from tests.fuzz.files import damage
from tests.mutation import OWN_SCENARIOS, REPOSITORY, Source, mutate, sources, write_mutant

CASE, OUT = "{case}", "{out}"
"""In arguments: the folder of an input's files, and the one for what is made of them"""
_XML = (".xosc", ".xodr", ".xml", ".osm")


class Input(NamedTuple):
    """Arguments of a call, with `CASE` and `OUT` for the folders; the file that
    it is made from; changes of it in words.
    """

    arguments: tuple[str, ...]
    source: str
    changes: tuple[str, ...]


class Kind(NamedTuple):
    """A kind of input.

    Attributes:
        make: writes an input into an empty folder; the second folder keeps seeds that take time to
            make.
        call: gets the arguments, with folders in them.
        codes: exit codes that what a file holds may lead to.
        weight: how often it is drawn, of all kinds.
        checked: end of the names of rules; a green answer is a defect where a file breaks one and
            nothing is remarked.
    """

    make: Callable[[Path, Random, Path], Input]
    call: Callable[[Sequence[str]], Answer]
    codes: frozenset[int]
    weight: float
    checked: str | None = None


def kinds(sources: Sequence[Source]) -> dict[str, Kind]:
    """All kinds by name, those of scenarios made from the sources."""
    from runner.exchange.exports import TARGETS

    run = ("--world", "kinematic", "--max-time", "2", "--sample", "2")
    formats = ("text", "json", "junit", "xqar", "sarif")
    lists, of_file, of_run = ("text", "json", "csv"), {0, 3, 4}, frozenset({0, 1, 3, 4, 6})

    def scenario(
        arguments: Sequence[str], *more: Sequence[str]
    ) -> Callable[[Path, Random, Path], Input]:
        return partial(_scenario, sources, arguments, more)

    found = {
        "check": Kind(scenario(("xosc-check", CASE), *(("--format", each) for each in formats)),
            command, frozenset({0, 1}), 26),
        "list": Kind(scenario(("xosc-list", CASE), *(("--format", each) for each in lists)),
            command, frozenset(of_file), 10),
        "dry": Kind(scenario(("xosc-run", "--dry-run", "--sample", "2")), command,
            frozenset({0, 3, 4, 6}), 10, ""),
        "run": Kind(scenario(("xosc-run", *run, "--out", OUT)), command, of_run, 5, ""),
        "sumo": Kind(scenario(("xosc-run", "--max-time", "1", "--sample", "2", "--out", OUT)),
            command, of_run, 1.0, ""),
        "replay": Kind(_replay, command, frozenset({0, 3}), 0.6),
        "model": Kind(_model, _load_model, frozenset({0, 3}), 1.5),
        "windows": Kind(_windows, _load_windows, frozenset({0, 3}), 4),
        "lanelet2": Kind(_lanelets, _convert, frozenset(of_file), 2),
    }  # fmt: skip
    for target in TARGETS.values():
        more = (*run, "--quiet") if target.of_run else ("--sample", "2")
        arguments = ("xosc-export", "--to", target.name, "--out", OUT, *more)
        found[f"export {target.name}"] = Kind(
            scenario(arguments),
            command,
            frozenset(of_file | {6} if target.of_run else of_file),
            0.4 if target.of_run else 1.0,
            "" if target.of_run else "valid_schema",
        )
    from tests.recognition.recordings.test_corruption import EXAMPLES

    for name in EXAMPLES:
        found[f"recordings {name}"] = Kind(
            partial(_recording, name, EXAMPLES[name].write), _read, frozenset(of_file), 3
        )
    for name, (
        write,
        weight,
    ) in _WITH_MAPS.items():  # exit code 2: the recording has lost its map, and no option names one
        found[f"sites {name}"] = Kind(
            partial(_recording, name, write), _read_site, frozenset(of_file | {2}), weight
        )
    return found


# inputs ---------------------------------------------------------------------------------------


def _scenario(
    sources: Sequence[Source],
    arguments: Sequence[str],
    more: Sequence[Sequence[str]],
    folder: Path,
    random: Random,
    seeds: Path,
) -> Input:
    (source,) = random.choices(
        sources, [1.0 / sum(file.stat().st_size for file in each.files) for each in sources]
    )
    further = random.choice(more) if more else ()
    mutant = write_mutant(source, folder, random)
    path = f"{CASE}/{mutant.path.relative_to(folder).as_posix()}"
    given = [CASE if each == CASE else each for each in arguments]
    return Input(
        (*given, *(() if CASE in given else (path,)), *further), source.path.name, mutant.changes
    )


def _changed(
    seed: Path, folder: Path, random: Random, endings: tuple[str, ...] = ()
) -> tuple[str, ...]:
    """Copy a seed's files, and change one to three of them."""
    shutil.copytree(seed, folder, dirs_exist_ok=True)
    files = sorted(
        file
        for file in folder.rglob("*")
        if file.is_file() and (not endings or file.suffix in endings)
    )
    changes = []
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        file = random.choice(files)
        if file.is_file():
            in_xml = file.suffix in _XML and random.random() < 0.8
            with suppress(
                SyntaxError, ValueError, OSError
            ):  # no tree is left that a further change could be made of
                changes += mutate(file, random) if in_xml else [damage(file, random)]
    return tuple(changes)


def _recording(
    name: str, write: Callable[[Path], object], folder: Path, random: Random, seeds: Path
) -> Input:
    seed = seeds / name
    if not seed.is_dir():
        unfinished = seed.with_name(f"{name} unfinished")  # what a killed process leaves is no seed
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.mkdir(parents=True)
        write(unfinished)
        unfinished.rename(seed)
    return Input((CASE, OUT), name, _changed(seed, folder, random))


def _argoverse_scenario(folder: Path) -> None:
    from tests.recognition.recordings.test_argoverse import write_scenario

    write_scenario(folder)


def _argoverse_log(folder: Path) -> None:
    from tests.recognition.recordings.test_argoverse import write_log

    write_log(folder / "log1")


def _nuscenes(folder: Path) -> None:
    from tests.recognition.recordings.test_nuscenes import write

    write(folder)


def _waymo(folder: Path) -> None:
    from tests.recognition.recordings.test_waymo import scene

    (folder / "scene.json").write_text(json.dumps(scene()), encoding="utf-8")


def _osi(folder: Path) -> None:
    from tests.runner.files import scenario

    scenario(folder / "files", stop=1.0)
    answer = command(
        [
            "xosc-export",
            *_TRACE,
            str(folder / "files" / "scenario.xosc"),
            "--out",
            str(folder / "out"),
        ]
    )
    assert answer.code == 0, answer
    for trace in folder.glob("out/**/*.mcap"):
        trace.rename(folder / trace.name)
    for part in ("files", "out"):
        shutil.rmtree(folder / part)


def _runs(folder: Path) -> None:
    from tests.runner.files import scenario

    scenario(folder / "files", stop=0.5)
    run = ("xosc-run", "--world", "kinematic", "--quiet", "--allow-inconclusive")
    answer = command([*run, str(folder / "files" / "scenario.xosc"), "--out", str(folder / "out")])
    assert answer.code == 0, answer


_TRACE = ("--to", "osi", "--world", "kinematic", "--quiet", "--allow-inconclusive")
_WITH_MAPS: dict[str, tuple[Callable[[Path], None], float]] = {
    "Argoverse 2": (_argoverse_scenario, 1.5),
    "Argoverse 2 log": (_argoverse_log, 1.5),
    "nuScenes": (_nuscenes, 1.5),
    "Waymo": (_waymo, 1.5),
    "OSI": (_osi, 1.5),
    "runs": (_runs, 1.0),
}
"""Writers of recordings that bring a map along, and how often each is drawn"""


def _lanelets(folder: Path, random: Random, seeds: Path) -> Input:
    from tests.xodr.formats.lanelet2.lanelet_maps import four_way, two_lanes

    seed = seeds / "lanelet2" / random.choice(("two", "four"))
    if not seed.is_dir():
        seed.mkdir(parents=True)
        (four_way() if seed.name == "four" else two_lanes()).write(seed)
    return Input((f"{CASE}/map.osm", f"{OUT}/map.xodr"), seed.name, _changed(seed, folder, random))


def _replay(folder: Path, random: Random, seeds: Path) -> Input:
    from tests.runner.files import distribution, scenario

    seed = seeds / "batch"
    if not seed.is_dir():
        files = seeds / "batch files"
        scenario(files, stop=0.5)
        sets = distribution(files, "sets", {"Gap": (40.0, 50.0, 10.0)})
        answer = command(["xosc-run", "--world", "kinematic", str(sets), "--out", str(seed)])
        assert answer.code == 0, answer
    changes = _changed(seed, folder, random)
    runs = sorted(each.name for each in seed.iterdir() if each.is_dir())
    if random.random() < 0.5:
        return Input(("xosc-replay", CASE), "batch", changes)
    page = ".html" if random.random() < 0.9 else ".png"
    return Input(
        ("xosc-replay", f"{CASE}/{random.choice(runs)}", "--out", f"{OUT}/page{page}"),
        "run",
        changes,
    )


def _windows(folder: Path, random: Random, seeds: Path) -> Input:
    import numpy as np

    from recognition.trfe.training.windows import Windows

    seed = seeds / "windows"
    if not seed.is_dir():
        names, numbers = np.array([f"r{k}" for k in range(12)]), np.arange(12)
        Windows(np.zeros((12, 4, 3, 5), np.float16), numbers % 3, names, names, numbers / 2.0).save(
            seed
        )
    return Input((CASE,), "windows", _changed(seed, folder, random))


def _model(folder: Path, random: Random, seeds: Path) -> Input:
    import_module(
        "recognition.catalogue.model"
    )  # with PyTorch, whose time and memory are no input's
    seed = seeds / "model"
    if not seed.is_dir():
        from recognition.trfe.config import Config
        from recognition.trfe.discovery.candidates import Clustering
        from recognition.trfe.storage import save
        from recognition.trfe.trfe import TRFE
        from tests.recognition.clouds import clouds

        config = Config(trees=3, delta=0.03, clustering=Clustering(epochs=1, ramp=1))
        save(TRFE(config).fit(*clouds([1, 2, 3], 20, seed=0), *clouds([1, 2, 3], 20, seed=1)), seed)
    return Input((CASE,), "model", _changed(seed, folder, random))


# calls ----------------------------------------------------------------------------------------


def command(arguments: Sequence[str]) -> Answer:
    """A command in this process, as a shell would start it."""
    name = arguments[0]
    return _captured(partial(_started, name, arguments))


def _started(name: str, arguments: Sequence[str]) -> None:
    before = sys.argv, list(sys.path)
    sys.argv = [name, *arguments[1:]]
    try:
        main(name)()
    finally:
        sys.argv, sys.path[:] = before[0], before[1]


def _captured(call: Callable[[], object]) -> Answer:
    streams = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (
        io.TextIOWrapper(io.BytesIO(), "utf-8", write_through=True, newline="\n") for _ in streams
    )
    code = 0
    try:
        call()
    except SystemExit as end:
        code = int(end.code or 0)
    except BaseException:
        code = 5
        traceback.print_exc()
    finally:
        texts = [
            stream.buffer.getvalue().decode("utf-8", "backslashreplace")
            for stream in (sys.stdout, sys.stderr)
        ]  # type: ignore[attr-defined]
        sys.stdout, sys.stderr = streams
    return Answer(code, *texts)


def _reader(read: Callable[..., object]) -> Callable[[Sequence[str]], Answer]:
    """A reader as a command would call it: errors for users are a line and an
    exit code, others tracebacks.
    """

    def call(arguments: Sequence[str]) -> Answer:
        def reading() -> None:
            from schemas.common.errors import ToolchainError, describe

            try:
                read(*map(Path, arguments))
            except (ToolchainError, MemoryError) as error:
                message, code = describe(error)
                print(f"reader: {message}", file=sys.stderr)
                raise SystemExit(code) from None

        return _captured(reading)

    return call


@_reader
def _read(folder: Path, out: Path) -> None:
    from recognition import recordings as datasets

    for source in datasets.open(folder, roads=out).sources:
        source.load()


@_reader
def _read_site(folder: Path, out: Path) -> None:
    from recognition import recordings as datasets
    from recognition.scenes import site_of

    for source in datasets.open(folder, roads=out).sources:
        site_of(source, source.load(), out)


@_reader
def _convert(map: Path, road: Path) -> None:
    from xodr.formats.lanelet2 import convert

    convert(map, None, road)


@_reader
def _load_windows(folder: Path) -> None:
    from recognition.trfe.training.windows import Windows

    windows = Windows.load(folder)
    len(windows.inputs)


@_reader
def _load_model(folder: Path) -> None:
    from recognition.catalogue.model import unseen_sites
    from recognition.trfe.storage import load

    unseen_sites(folder)
    load(folder)


def warm_up(folder: Path) -> None:
    """Let commands read valid and invalid files of each version, so that
    schemas, rules and options are at hand for inputs.

    All of them only read XML: none starts a thread or a simulator, which a forked child would lack.
    """
    files = [file for place in OWN_SCENARIOS for file in sorted(place.rglob("*.xosc"))][::8]
    roads = sorted((REPOSITORY / "xodr" / "library").glob("*.xodr"))[::4]
    folder.mkdir(parents=True)
    for file in (*files, *roads):
        text = file.read_text(encoding="utf-8")
        text = text.replace("<FileHeader ", '<FileHeader odd="1" ').replace(
            "<header ", '<header odd="1" '
        )
        (folder / file.name).write_text(text, encoding="utf-8")
    command(["xosc-check", str(folder), *map(str, files), *map(str, roads)])
    command(["xosc-list", *map(str, files)])
    command(["xosc-run", "--dry-run", "--world", "kinematic", "--sample", "2", *map(str, files)])
    shutil.rmtree(folder)


@cache
def own_kinds() -> dict[str, Kind]:
    """Kinds by name, made from the scenarios of this repository."""
    return kinds(sources(OWN_SCENARIOS))
