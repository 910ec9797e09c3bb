"""Speed of schema checks in one process: files a second, against libxml2 doing nothing but parse
and validate.

    python benchmarks/check_speed.py PATH... [--repeat N]

Only files whose version has an XSD at hand are counted. Start-up, which compiles each XSD once, is
not counted.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from lxml import etree

from schemas import check
from schemas.common.terminal.files import expand
from schemas.common.xml import parse
from schemas.validate import violations
from schemas.versions.registry import Schema, detect, schema_for


def main() -> None:
    """Print the three speeds and their ratios."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("paths", nargs="+", help="files, folders and globs")
    arguments.add_argument(
        "--repeat", type=int, default=5, help="passes over the files, of which the median counts"
    )
    options = arguments.parse_args()
    files = _validatable(expand(options.paths))
    if not files:
        raise SystemExit("no file of a version whose XSD is at hand")
    compiled = {schema: etree.XMLSchema(schema.tree()) for _, schema in files}

    def plain(path: Path, schema: Schema) -> object:
        return compiled[schema].validate(etree.parse(path))

    def schema_check(path: Path, schema: Schema) -> object:
        tree = parse(path)
        kind = detect(tree)
        found = schema_for(kind.standard, kind.version)
        return violations(tree, found) if found else None

    def full_check(path: Path, schema: Schema) -> object:
        return check(path)

    reference = _speed(plain, files, options.repeat)
    print(f"{len(files)} files, median of {options.repeat} passes")
    print(f"{'plain libxml2':<24}{reference:>8.0f} files/s")
    for name, work in (("schema check", schema_check), ("check with all rules", full_check)):
        speed = _speed(work, files, options.repeat)
        print(
            f"{name:<24}{speed:>8.0f} files/s  {reference / speed:.2f} times the "
            "time of plain libxml2"
        )


def _validatable(paths: Sequence[Path]) -> list[tuple[Path, Schema]]:
    kinds = [(path, detect(parse(path))) for path in paths]
    found = [(path, schema_for(kind.standard, kind.version)) for path, kind in kinds]
    return [(path, schema) for path, schema in found if schema is not None and not schema.xsd_1_1]


def _speed(
    work: Callable[[Path, Schema], object], files: Sequence[tuple[Path, Schema]], repeat: int
) -> float:
    for path, schema in files:
        work(path, schema)  # warms caches, which is start-up
    times = []
    for _ in range(repeat):
        start = time.process_time()
        for path, schema in files:
            work(path, schema)
        times.append(time.process_time() - start)
    return len(files) / statistics.median(times)


if __name__ == "__main__":
    main()
