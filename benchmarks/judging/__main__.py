"""Judgement of recognition by people: draws of findings and of vehicles, pages to label them, and
the figures of the answers.

    python -m benchmarks.judging find RECORDINGS... --out FINDINGS [--model DIR | --rules]
        [--signalised]
    python -m benchmarks.judging draw FINDINGS RECORDINGS... --out DIR --keys DIR [--findings 90]
        [--vehicles 25] [--seed 0] [--singled-out] [--hidden]
    python -m benchmarks.judging report KEY ANSWERS...

`find` writes what the rules and a model find. `draw` draws findings (DIR/precision), and vehicles
with stretches of their tracks (DIR/recall); with `--singled-out`, stretches in which a vehicle
turns, shifts, brakes, meets or crosses another one. Each folder gets a page with films and keys
that writes the answers (`index.html`), a picture and a text for each item, and a table to fill in
(`answers.csv`). The sources of the findings are in the folder of keys only. `report` compares the
answers of any number of reviewers with a key.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.judging.draws import (
    Library,
    draw_findings,
    draw_hidden,
    draw_vehicles,
    find,
    read_findings,
    write_findings,
)
from benchmarks.judging.items import write_items
from benchmarks.judging.report import report
from recognition.catalogue.model import load
from recognition.catalogue.pipeline import SHIPPED
from recognition.labels import Rules
from schemas.common.errors import ToolchainError


def main() -> None:
    """Draw, or report."""
    arguments = argparse.ArgumentParser(
        prog="python -m benchmarks.judging", description=__doc__.split("\n\n")[0]
    )
    commands = arguments.add_subparsers(dest="command", required=True)
    finding = commands.add_parser("find")
    finding.add_argument("recordings", nargs="+", type=Path)
    finding.add_argument("--out", type=Path, required=True)
    finding.add_argument("--model", type=Path, default=SHIPPED)
    finding.add_argument("--rules", action="store_true", help="no model")
    finding.add_argument(
        "--signalised",
        action="store_true",
        help="count junctions with traffic lights as well: reviewers do not see lights",
    )
    drawing = commands.add_parser("draw")
    drawing.add_argument("found", type=Path)
    drawing.add_argument("recordings", nargs="+", type=Path)
    drawing.add_argument("--out", type=Path, required=True)
    drawing.add_argument(
        "--keys",
        type=Path,
        required=True,
        help="folder for the sources, which reviewers must not see",
    )
    drawing.add_argument("--findings", type=int, default=90)
    drawing.add_argument(
        "--hidden",
        action="store_true",
        help="draw so many findings of each set, and let reviewers say their classes",
    )
    drawing.add_argument("--vehicles", type=int, default=25)
    drawing.add_argument("--seed", type=int, default=0)
    drawing.add_argument(
        "--singled-out",
        action="store_true",
        help="draw vehicles by moments that plain kinematics single out",
    )
    reporting = commands.add_parser("report")
    reporting.add_argument("key", type=Path)
    reporting.add_argument("answers", nargs="+", type=Path, help="answers of one reviewer each")
    options = arguments.parse_args()
    try:
        if options.command == "report":
            print(report(options.key, options.answers))
        elif options.command == "find":
            model = None if options.rules else load(options.model, sorts=True, discover=False)
            rules = Rules(signalised=options.signalised)
            write_findings(find(options.recordings, model, rules), options.out)
        else:
            found, library = read_findings(options.found), Library(options.recordings)
            findings = (
                draw_hidden(found, library, options.findings, options.seed)
                if options.hidden
                else draw_findings(found, options.findings, options.seed)
            )
            write_items(
                findings, library, options.out / "precision", options.keys / "precision.json"
            )
            vehicles = draw_vehicles(
                found, library, options.vehicles, options.seed, options.singled_out
            )
            write_items(vehicles, library, options.out / "recall", options.keys / "recall.json")
    except ToolchainError as error:
        raise SystemExit(str(error)) from None


if __name__ == "__main__":
    main()
