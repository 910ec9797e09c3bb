"""Command line of the agreement report."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from recognition.labels import Rules
from recognition.study.agreement.plots import plots
from recognition.study.agreement.report import report
from recognition.study.agreement.survey import survey
from schemas.errors import ToolchainError


def main() -> int:
    """Label all recordings of a folder, write the report."""
    parser = argparse.ArgumentParser(prog="python -m recognition.study.agreement", description=__doc__)
    parser.add_argument("data", type=Path, help="folder or file with recordings")
    parser.add_argument("out", type=Path, help="folder for agreement.md and its plots")
    parser.add_argument("--signalised", action="store_true", help="count junctions with traffic lights as well")
    options = parser.parse_args()
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        places = survey(options.data, options.out / "roads", Rules(signalised=options.signalised))
        drawn = {place.name: plots(place, options.out) for place in places}
        target = options.out / "agreement.md"
        target.write_text(report(places, drawn), encoding="utf-8")
    except (ToolchainError, OSError) as error:
        print(error, file=sys.stderr)
        return error.exit_code if isinstance(error, ToolchainError) else 2
    print(target)
    return 0


if __name__ == "__main__":
    sys.exit(main())
