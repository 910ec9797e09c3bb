"""Fuzz readers and expressions guided by coverage, with atheris.

    pip install atheris
    python -m benchmarks.guided TARGET [--seconds 60] [--seed 0] [--keep DIR]

TARGET is `expressions`, `scenarios` (reading, resolving and compiling) or `roads`. Inputs begin
with the expressions, scenarios and roads of the library. Any exception but a refusal
(`ToolchainError`)
is a defect: the input is kept in DIR, and the exit code is not 0. Exit code 2: atheris is not
installed. Unlike `benchmarks.fuzz`, inputs are bytes that reach new branches, in one process.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
_SCENARIOS, _ROADS = ROOT / "xosc" / "library", ROOT / "xodr" / "library"
_LONGEST = 4096
"""Bytes of an expression"""
_LARGEST = 65536
"""Bytes of a file"""


def expressions(folder: Path) -> Callable[[bytes], None]:
    """Evaluate an expression with two parameters."""
    from schemas.common.errors import ToolchainError
    from schemas.expressions import evaluate

    def test(data: bytes) -> None:
        with suppress(ToolchainError):
            evaluate(data.decode("utf-8", "replace"), {"Gap": 20.0, "Speed": 13.9}.get)

    return test


def scenarios(folder: Path) -> Callable[[bytes], None]:
    """Read, resolve and compile a scenario beside the library's roads."""
    from runner.judging.execution import prepare
    from schemas.common.errors import ToolchainError

    path = folder / "xosc" / "library" / "input.xosc"
    path.parent.mkdir(parents=True)
    shutil.copytree(_ROADS, folder / "xodr" / "library")

    def test(data: bytes) -> None:
        path.write_bytes(data)
        with suppress(ToolchainError):
            prepare(path)

    return test


def roads(folder: Path) -> Callable[[bytes], None]:
    """Read a road network."""
    import xodr
    from schemas.common.errors import ToolchainError

    path = folder / "input.xodr"

    def test(data: bytes) -> None:
        path.write_bytes(data)
        with suppress(ToolchainError):
            xodr.load(path)

    return test


TARGETS = {each.__name__: each for each in (expressions, scenarios, roads)}


def seeds(target: str) -> list[bytes]:
    """Inputs to begin with."""
    folder, pattern = (_ROADS, "*.xodr") if target == "roads" else (_SCENARIOS, "*.xosc")
    texts = [path.read_bytes() for path in sorted(folder.glob(pattern))]
    if target == "expressions":
        return sorted({each for text in texts for each in re.findall(rb"\$\{[^}]*\}", text)})
    return sorted((text for text in texts if len(text) <= _LARGEST), key=len)[:40]


def main() -> None:
    """Fuzz a target."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("target", choices=TARGETS)
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0, help="0: another one each time")
    parser.add_argument("--keep", type=Path, default=Path("defects"))
    options = parser.parse_args()
    try:
        atheris: Any = import_module("atheris")
    except ImportError:
        print("benchmarks.guided needs atheris: pip install atheris", file=sys.stderr)
        sys.exit(2)
    with tempfile.TemporaryDirectory(prefix="guided_") as scratch:
        corpus = Path(scratch) / "corpus"
        corpus.mkdir()
        for number, seed in enumerate(seeds(options.target)):
            (corpus / str(number)).write_bytes(seed)
        with atheris.instrument_imports(include=["schemas", "xosc", "xodr", "runner"]):
            test = TARGETS[options.target](Path(scratch) / "work")
        (Path(scratch) / "work").mkdir(exist_ok=True)
        options.keep.mkdir(parents=True, exist_ok=True)
        longest = _LONGEST if options.target == "expressions" else _LARGEST
        arguments = [
            sys.argv[0],
            str(corpus),
            f"-max_total_time={options.seconds}",
            f"-seed={options.seed}",
            f"-max_len={longest}",
            f"-artifact_prefix={options.keep}/",
        ]
        atheris.Setup(arguments, test)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
