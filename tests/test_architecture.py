"""The rooms of the house: imports go down the floors and never in circles,
products know no study, files are subjects.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from statistics import median

import pytest

ROOT = Path(__file__).parents[1]
FLOORS = {
    "schemas": 0,
    "xosc": 1,
    "xodr": 1,
    "runner": 2,
    "recognition": 3,
    "generation": 4,
    "studies": 5,
    "xosc_toolchain": 5,
}
"""The packages; one imports those of lower floors only."""
MOST_ENTRIES = 8
"""Entries of a package, and of a room, that a newcomer sees: modules and folders"""
ROOMS = {
    "schemas": "common expressions versions validate osi catalogs checks xosc_check",
    "xosc": "rules document resolve writing distributions exports listing",
    "xodr": "model graph lookup reader builders formats rules",
    "runner": "engine systems judging batch exchange view xosc_run",
    "recognition": "recordings recorder scenes labels trfe catalogue xosc_recognize",
    "generation": "space search clock estimation pipeline report loop xosc_generate",
}
"""Rooms of each package, the lowest first; one imports those before it only.
Where rooms are named in strings, that counts.
"""
OF_KINDS = {"xosc/exports": "one module a target", "schemas/common": "used by all, knows none"}
"""Rooms that are lists of kinds or tools"""
BESIDE_ROOMS = {"runner.recording": "who was where when; the engine writes it, all others read it"}
"""Modules that rooms share"""
KEPT_ARROWS = {
    ("schemas.checks.registry", "xosc.rules"): "rules are kinds: they are found in their folders",
    ("schemas.checks.registry", "xodr.rules"): "rules are kinds: they are found in their folders",
}
"""Arrows against the order, each with its reason; new ones are to be turned round instead"""
TEMPLATES = ROOT / "xosc_toolchain" / "templates"
"""Folder of files that are copied into packages of users; no module imports them"""
MOST_FILES = 489
"""Product files"""
MEDIAN = (120, 290)
"""Lines of the median product file"""
FRAGMENT = 60
"""Lines below which a file with a single importer belongs into that"""
KEPT_FRAGMENTS: dict[str, str] = {}
"""Fragments with a single importer, each with the reason"""
MOST_OF_A_NAME = 4
"""Modules of one name"""
ENTRY_POINTS = ("__init__", "__main__")
"""Names that Python asks for"""


@cache
def imports() -> dict[str, frozenset[str]]:
    """The modules of all packages, each with those that it imports anywhere, for types too."""
    files = {
        _name(path): path
        for package in FLOORS
        for path in sorted((ROOT / package).rglob("*.py"))
        if path.parent != TEMPLATES or path.name == "__init__.py"
    }
    return {name: frozenset(_imported(path, files.keys()) - {name}) for name, path in files.items()}


def _name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _imported(path: Path, modules: object) -> set[str]:
    """Names of modules that a file imports; `from a.b import c` is the module
    a.b.c where there is one, else a.b.
    """
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: imports are absolute"
            found.update(_target(f"{node.module}.{alias.name}", modules) for alias in node.names)
    return {name for name in found if name in modules}  # type: ignore[operator]


def _target(name: str, modules: object) -> str:
    return name if name in modules else name.rpartition(".")[0]  # type: ignore[operator]


def circles(graph: dict[str, frozenset[str]]) -> list[list[str]]:
    """Groups of modules that import each other, directly or over others (strongly connected
    components, after Kosaraju).
    """
    order: list[str] = []
    seen: set[str] = set()

    def visit(start: str, links: dict[str, frozenset[str]], into: list[str]) -> None:
        stack = [(start, iter(sorted(links[start])))]
        seen.add(start)
        while stack:
            name, rest = stack[-1]
            following = next((each for each in rest if each not in seen), None)
            if following is None:
                into.append(name)
                stack.pop()
            else:
                seen.add(following)
                stack.append((following, iter(sorted(links[following]))))

    for name in graph:
        if name not in seen:
            visit(name, graph, order)
    back = {name: frozenset(each for each in graph if name in graph[each]) for name in graph}
    seen.clear()
    groups: list[list[str]] = []
    for name in reversed(order):
        if name not in seen:
            groups.append([])
            visit(name, back, groups[-1])
    return sorted(sorted(group) for group in groups if len(group) > 1)


def test_circles_are_found() -> None:
    graph = {
        "a": {"b"},
        "b": {"c"},
        "c": {"a", "d"},
        "d": {"e"},
        "e": set(),
        "f": {"g"},
        "g": {"f"},
    }
    assert circles({name: frozenset(links) for name, links in graph.items()}) == [
        ["a", "b", "c"],
        ["f", "g"],
    ]


def test_no_module_imports_itself_over_others() -> None:
    assert len(imports()) > 500
    assert circles(imports()) == []


def test_products_import_no_study() -> None:
    def of_study(name: str) -> bool:
        return name.startswith("studies.")

    links = [
        (name, other) for name, others in imports().items() for other in others if of_study(other)
    ]
    assert any(of_study(name) for name, _ in links), "studies import each other"
    assert [link for link in links if not of_study(link[0])] == []


def test_floors_import_only_lower_floors() -> None:
    links = [(name, other) for name, others in imports().items() for other in others]
    packages = [
        (name.partition(".")[0], other.partition(".")[0], name, other) for name, other in links
    ]
    assert [
        link for (*link,) in packages if link[0] != link[1] and FLOORS[link[1]] >= FLOORS[link[0]]
    ] == []


@cache
def arrows() -> dict[str, frozenset[str]]:
    """The modules of all packages, each with those that it imports or names in a string
    (`import_module`, plug-ins).
    """
    modules = imports().keys()
    named = {name: _named(_file(name), modules) for name in modules}
    return {name: imports()[name] | named[name] - {name} for name in modules}


def _named(path: Path, modules: object) -> frozenset[str]:
    """Modules whose dotted names are strings of a file, alone or before a colon."""
    texts = (
        node.value.partition(":")[0]
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and "." in node.value
    )
    return frozenset(text for text in texts if text in modules)  # type: ignore[operator]


def _file(name: str) -> Path:
    path = ROOT / name.replace(".", "/")
    return file if (file := path.with_suffix(".py")).exists() else path / "__init__.py"


def against(name: str, other: str) -> bool:
    """Whether an arrow leads to a higher floor, or to a room that comes later."""
    package, there = name.partition(".")[0], other.partition(".")[0]
    if package != there:
        return FLOORS[there] >= FLOORS[package]
    rooms = ROOMS.get(package, "").split()
    if name in BESIDE_ROOMS or other in BESIDE_ROOMS or "." not in name or "." not in other:
        return False
    room, into = name.split(".")[1], other.split(".")[1]
    return rooms != [] and rooms.index(into) > rooms.index(room)


@pytest.mark.parametrize("package", ROOMS)
def test_every_room_has_its_place_in_the_order(package: str) -> None:
    entries = {
        entry
        for entry in entries_of(ROOT / package)
        if (ROOT / package / entry / "__init__.py").exists()
    }
    entries |= {
        entry for entry in entries_of(ROOT / package) if (ROOT / package / f"{entry}.py").exists()
    }
    shared = {name.partition(".")[2] for name in BESIDE_ROOMS if name.startswith(f"{package}.")}
    assert entries - shared == set(ROOMS[package].split())


def test_arrows_between_rooms_go_one_way() -> None:
    links = {(name, other) for name, others in arrows().items() for other in others}
    assert {link for link in links if against(*link)} - KEPT_ARROWS.keys() == set()


def test_kept_arrows_are_there() -> None:
    links = {
        (name, other)
        for name, others in arrows().items()
        for other in others
        if against(name, other)
    }
    assert KEPT_ARROWS.keys() - links == set(), "take them off the list"


def entries_of(folder: Path) -> list[str]:
    """Entries of a package that a newcomer sees: modules, and folders of modules or of data."""
    return sorted(
        path.stem
        for path in folder.iterdir()
        if not path.name.startswith(("_", ".")) and (path.is_dir() or path.suffix == ".py")
    )


@pytest.mark.parametrize("package", ROOMS)
def test_a_package_and_its_rooms_show_few_entries(package: str) -> None:
    folders = [ROOT / package, *(path.parent for path in (ROOT / package).glob("*/__init__.py"))]
    counts = {folder.relative_to(ROOT).as_posix(): entries_of(folder) for folder in folders}
    assert {
        name: found
        for name, found in counts.items()
        if len(found) > MOST_ENTRIES and name not in OF_KINDS
    } == {}


def product_files() -> dict[str, Path]:
    """The files of the product by module name."""
    modules = [name for name in imports() if not name.startswith("studies")]
    files = {name: ROOT / name.replace(".", "/") for name in modules}
    return {
        name: file if (file := path.with_suffix(".py")).exists() else path / "__init__.py"
        for name, path in files.items()
    }


def lines_of(path: Path) -> int:
    """Number of lines of a file."""
    return len(path.read_text(encoding="utf-8").splitlines())


def test_files_are_subjects() -> None:
    lines = [lines_of(path) for path in product_files().values()]
    assert len(lines) <= MOST_FILES
    assert MEDIAN[0] <= median(lines) <= MEDIAN[1]


def fragments() -> Iterator[str]:
    """Modules that are short and that a single other one imports."""
    importers = Counter(other for others in imports().values() for other in others)
    for name, path in product_files().items():
        if path.stem not in ENTRY_POINTS and importers[name] == 1 and lines_of(path) < FRAGMENT:
            yield name


def test_no_fragment_has_a_file_of_its_own() -> None:
    assert set(fragments()) == KEPT_FRAGMENTS.keys(), (
        "merge it with the module that imports it, or say why not"
    )


def test_module_names_say_what_they_are() -> None:
    names = Counter(path.stem for path in product_files().values())
    assert {
        name: count
        for name, count in names.items()
        if count > MOST_OF_A_NAME and name not in ENTRY_POINTS
    } == {}


def test_classes_get_names_of_their_own() -> None:
    homes: dict[str, set[str]] = {}
    for name, path in product_files().items():
        for defined in re.findall(r"^class (\w+)", path.read_text(encoding="utf-8"), re.MULTILINE):
            homes.setdefault(defined, set()).add(name)
    assert {name: sorted(modules) for name, modules in homes.items() if len(modules) > 1} == {}, (
        "give one of them another name"
    )


def test_modules_of_commands_are_commands_themselves() -> None:
    silent = [
        str(path.relative_to(ROOT))
        for package in ROOMS
        for path in sorted((ROOT / package).rglob("xosc_*.py"))
        if "\ndef main() -> None:" in (text := path.read_text("utf-8"))
        and 'if __name__ == "__main__":\n    main()' not in text
    ]
    assert silent == [], "python -m MODULE would do nothing, with exit code 0"


PROCESSES = {
    "runner.batch.pool": (
        "makes them: jobs without an end, tasks in order, on this machine or by Ray"
    ),
    "generation.loop.searches": "keeps one for each target, which has its densities at hand",
    "xosc_toolchain.explore_site": "keeps one that answers a page",
    "studies.recognition.protocol.processes": "looks at the store while seeds are worked on",
}
"""Modules that hand work to processes by themselves, each with the reason;
others use `runner.batch.pool`
"""


def test_work_goes_to_processes_by_one_module() -> None:
    files = {name: ROOT / name.replace(".", "/") for name in imports()}
    makes = re.compile(
        r"\bexecutor\([\da-z]|\bProcessPoolExecutor\(|\.remote\(|multiprocessing\.Process\("
    )
    found = {
        name
        for name, path in files.items()
        if (file := path.with_suffix(".py")).exists() and makes.search(file.read_text("utf-8"))
    }
    assert found == PROCESSES.keys()
