"""How long a recording of highD's size (17 minutes, 1,000 vehicles) takes to become a catalogue.

    python benchmarks/catalogue.py [--recording FOLDER] [--labels auto|rules] [--jobs N] [--profile FILE]

The recording is made first, by the recorder in highD's format, unless the folder has it; only what comes after is timed.
"""

from __future__ import annotations

import argparse
import cProfile
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from recognition.catalogue.pipeline import SHIPPED, ByRules, build
from recognition.catalogue.recognisers.model import load
from recognition.catalogue.stages import CatalogueSettings
from recognition.recorder.recorder import record_one
from recognition.recorder.sites import SITES

_LENGTH = 17.0 * 60.0
_TRAFFIC = 0.75
"""Of the traffic of the site with two lanes: a thousand vehicles in this time"""


def main() -> None:
    """Print times."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--recording", type=Path, help="folder of the recording")
    arguments.add_argument("--labels", choices=("auto", "rules"), default="auto")
    arguments.add_argument("--jobs", type=int, default=2, help="processes of the command")
    arguments.add_argument("--profile", type=Path, help="profile in this process instead, into this file")
    options = arguments.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.recording or Path(scratch) / "recording"
        if not folder.exists():
            site = SITES["motorway_two_lanes"]
            flows = tuple(flow._replace(rate=_TRAFFIC * flow.rate) for flow in site.flows)
            record_one(replace(site, flows=flows), folder, _LENGTH)
        out = Path(scratch) / "catalogue"
        if options.profile:
            recogniser = ByRules() if options.labels == "rules" else load(SHIPPED)
            with cProfile.Profile() as profile:
                build([folder], out, CatalogueSettings(), recogniser, lambda sources, _: sources)
            profile.dump_stats(options.profile)
            return
        start = time.perf_counter()
        command = [sys.executable, "-m", "recognition.cli", str(folder), "--labels", options.labels]
        subprocess.run([*command, "--out", str(out), "--jobs", str(options.jobs)], check=True)
        print(f"{time.perf_counter() - start:.1f} s with {options.jobs} jobs")


if __name__ == "__main__":
    main()
