"""Judgement of recognition by people: draws of findings and of vehicles, pages to label them, and the figures of the answers.

    python -m benchmarks.judging find RECORDINGS... --out FINDINGS [--model DIR]
    python -m benchmarks.judging precision FINDINGS RECORDINGS... --out DIR --key FILE [--number 90] [--seed 0]
    python -m benchmarks.judging recall FINDINGS RECORDINGS... --out DIR --key FILE [--number 25] [--seed 0]
    python -m benchmarks.judging report KEY ANSWERS...

`find` writes what the rules and a model find. `precision` draws findings, `recall` draws vehicles and stretches of their tracks.
DIR gets `index.html` (a page with films and keys that writes the answers), a picture and a text for each item, and `answers.csv`
to fill in. The sources of the findings are in KEY only. `report` compares the answers of any number of reviewers with the key.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.judging.draws import draw_findings, draw_vehicles, find, read_findings, write_findings
from benchmarks.judging.items import write_items
from benchmarks.judging.report import report
from recognition.catalogue.model import load
from recognition.catalogue.pipeline import SHIPPED
from schemas.common.errors import ToolchainError


def main() -> None:
    """Draw, or report."""
    arguments = argparse.ArgumentParser(prog="python -m benchmarks.judging", description=__doc__.split("\n")[0])
    commands = arguments.add_subparsers(dest="command", required=True)
    finding = commands.add_parser("find")
    finding.add_argument("recordings", nargs="+", type=Path)
    finding.add_argument("--out", type=Path, required=True)
    finding.add_argument("--model", type=Path, default=SHIPPED)
    for name, number in ("precision", 90), ("recall", 25):
        drawing = commands.add_parser(name)
        drawing.add_argument("findings", type=Path)
        drawing.add_argument("recordings", nargs="+", type=Path)
        drawing.add_argument("--out", type=Path, required=True)
        drawing.add_argument("--key", type=Path, required=True, help="file for the sources, which reviewers must not see")
        drawing.add_argument("--number", type=int, default=number)
        drawing.add_argument("--seed", type=int, default=0)
    reporting = commands.add_parser("report")
    reporting.add_argument("key", type=Path)
    reporting.add_argument("answers", nargs="+", type=Path, help="answers of one reviewer each")
    options = arguments.parse_args()
    try:
        if options.command == "report":
            print(report(options.key, options.answers))
        elif options.command == "find":
            write_findings(find(options.recordings, load(options.model, sorts=True, discover=False)), options.out)
        else:
            found = read_findings(options.findings)
            if options.command == "precision":
                drawn = draw_findings(found, options.number, options.seed)
            else:
                drawn = draw_vehicles(found, options.recordings, options.number, options.seed)
            write_items(drawn, options.recordings, options.out, options.key)
    except ToolchainError as error:
        raise SystemExit(str(error)) from None


if __name__ == "__main__":
    main()
