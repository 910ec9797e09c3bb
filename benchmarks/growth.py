"""Processor time of reading and compiling a file against the number of each element that may
repeat.

    python -m benchmarks.growth [--most 16000] [--only NAME] [--seconds 20]

Repeatable elements are those that the schema declares with a largest number above 1. Each is
repeated in the smallest file of the tests or the library that has one, with numbered
names: a scenario is compiled, of a variation file the first parameter sets are listed, a
catalogue is checked. The exponent b of time = a n^b is fitted to counts from `--most`/8 to
`--most`, without the time for the file as it is; a series ends early at a count that takes more
than `--seconds`. Exit code
1: an exponent is above `STEEPEST`.
"""

from __future__ import annotations

import argparse
import copy
import sys
import tempfile
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path
from time import process_time
from typing import NamedTuple

import numpy as np
from lxml import etree

from runner.judging.execution import prepare
from schemas.checks.checker import check
from schemas.common.errors import ToolchainError
from schemas.versions.registry import OPENSCENARIO, schema_for
from xosc.distributions.space import variations

ROOT = Path(__file__).parents[1]
FOLDERS = (
    ROOT / "tests" / "conformance",
    ROOT / "tests" / "oracles" / "repeated",
    ROOT / "xosc" / "library",
)
STEEPEST = 1.4
"""Exponent above which growth is not linear; n log n has 1.15 at these counts"""
_LEAST = 0.2
"""Processor time (s) of the largest count below which noise decides the exponent"""
_SETS = 100
"""Parameter sets that are listed: their number may be a power of that of the element"""
_XSD = "{http://www.w3.org/2001/XMLSchema}"


class Repeatable(NamedTuple):
    """An element that may occur many times.

    Attributes:
        parent: tag of the element that holds it.
        child: its tag.
    """

    parent: str
    child: str


class Growth(NamedTuple):
    """Processor times (s) of an element by its number, and the exponent; NaN where they are too
    short."""

    element: Repeatable
    times: dict[int, float]
    exponent: float


def repeatable(schema: Path) -> list[Repeatable]:
    """Return the elements of a schema that may occur more than once in their parents, by name."""
    root = etree.parse(schema).getroot()
    tags: dict[str, set[str]] = {}
    for element in root.iter(f"{_XSD}element"):
        tags.setdefault(element.get("type", ""), set()).add(element.get("name", ""))
    found = set()
    for kind in root.iter(f"{_XSD}complexType"):
        for element in kind.iter(f"{_XSD}element"):
            above = [
                element,
                *element.iterancestors(f"{_XSD}sequence", f"{_XSD}choice", f"{_XSD}all"),
            ]
            if any(each.get("maxOccurs", "1") not in ("0", "1") for each in above):
                for tag in tags.get(kind.get("name", ""), set()):
                    found.add(Repeatable(tag, element.get("name", "")))
    return sorted(found)


def examples(wanted: list[Repeatable]) -> dict[Repeatable, Path]:
    """Return the smallest file with each element."""
    files = [path for folder in FOLDERS for path in folder.rglob("*.xosc")]
    files.sort(key=lambda path: (path.stat().st_size, path))
    found: dict[Repeatable, Path] = {}
    for path in files:
        with suppress(etree.XMLSyntaxError):
            root = etree.parse(path).getroot()
            pairs = {
                Repeatable(str(parent.tag), str(each.tag))
                for each in root.iter(etree.Element)
                if (parent := each.getparent()) is not None
            }
            for pair in pairs.intersection(wanted):
                found.setdefault(pair, path)
    return found


def write(path: Path, element: Repeatable, number: int, folder: Path) -> Path:
    """Write a scenario with an element repeated so often, beside the original's roads and
    catalogues."""
    root = etree.parse(path).getroot()
    for each in (*root.iter("LogicFile"), *root.iter("SceneGraphFile"), *root.iter("Directory")):
        for name in ("filepath", "path"):
            if each.get(name):
                each.set(name, str((path.parent / each.get(name, "")).resolve()))
    first = next(each for each in root.iter(element.child) if _is_in(each, element.parent))
    parent, at = first.getparent(), first.getparent().index(first)  # type: ignore[union-attr]
    assert parent is not None
    copies = [copy.deepcopy(first) for _ in range(number)]
    for count, each in enumerate(copies):
        if "name" in each.attrib:
            each.set("name", f"{each.get('name')}_{count}")
    parent[at + 1 : at + 1] = copies
    target = folder / f"{element.parent}_{element.child}_{number}.xosc"
    etree.ElementTree(root).write(target, encoding="utf-8", xml_declaration=True)
    return target


def _is_in(element: etree._Element, tag: str) -> bool:
    parent = element.getparent()
    return parent is not None and parent.tag == tag


def read(path: Path) -> None:
    """Compile a scenario, list parameter sets of a variation file, check a
    catalogue; or refuse it.
    """
    root = etree.parse(path).getroot()
    with suppress(ToolchainError):
        if root.find("Catalog") is not None:
            check(path)
        elif root.find("ParameterValueDistribution") is not None:
            deque(islice(variations(path), _SETS), maxlen=0)
        else:
            prepare(path)


def seconds(path: Path) -> float:
    """Processor time (s) of reading a file."""
    start = process_time()
    read(path)
    return process_time() - start


def growth(element: Repeatable, path: Path, most: int, longest: float, folder: Path) -> Growth:
    """Measure the growth with an element of a file, up to a number or a time (s)."""
    base = min(seconds(write(path, element, 1, folder)) for _ in range(2))
    times: dict[int, float] = {}
    for number in (most // 8, most // 4, most // 2, most):
        times[number] = max(seconds(write(path, element, number, folder)) - base, 1e-3)
        if times[number] > longest:
            break
    if len(times) < 2 or max(times.values()) < _LEAST:
        return Growth(element, times, float("nan"))
    slope = np.polyfit(np.log([*times]), np.log([*times.values()]), 1)[0]
    return Growth(element, times, float(slope))


def measured(most: int, only: str, longest: float) -> Iterator[Growth]:
    """Yield the growth with each element of the newest schema that a file has,
    and name the others.
    """
    schema = schema_for(OPENSCENARIO, (1, 3))
    assert schema is not None
    wanted = [each for each in repeatable(schema.path) if only in "/".join(each)]
    files = examples(wanted)
    with tempfile.TemporaryDirectory(prefix="growth_") as folder:
        for element in wanted:
            if element in files:
                yield growth(element, files[element], most, longest, Path(folder))
            else:
                print(f"{'/'.join(element):60} in no file")


def main() -> None:
    """Print a line for each element."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--most", type=int, default=16000, help="largest number")
    parser.add_argument("--only", default="", help="part of PARENT/ELEMENT")
    parser.add_argument("--seconds", type=float, default=20.0, help="time at which a series ends")
    options = parser.parse_args()
    steep = 0
    for found in measured(options.most, options.only, options.seconds):
        number, time = [*found.times.items()][-1]
        again = found.exponent > STEEPEST
        steep += again
        note = "  ABOVE LINEAR" if again else ""
        name = "/".join(found.element)
        print(f"{name:60} {found.exponent:5.2f}  {time:7.2f} s at {number}{note}", flush=True)
    print(f"{steep} above {STEEPEST:g}")
    sys.exit(1 if steep else 0)


if __name__ == "__main__":
    main()
