"""Time that recordings of our own take, and the events of each class in them.

python benchmarks/record.py [--scale X] [--seed N] [--site NAME ...] [--jobs N] [--out DIR]
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections import Counter, defaultdict
from pathlib import Path

from recognition.labels import Label, label
from recognition.recorder import SITES, record
from recognition.recordings import open as open_data_set
from recognition.scenes import site_of

CLASSES = [one for one in Label if one > 0]


def main() -> None:
    """Print a table of sites and classes."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("--scale", type=float, default=0.05)
    arguments.add_argument("--seed", type=int, default=0)
    arguments.add_argument("--site", action="append", choices=list(SITES))
    arguments.add_argument("--jobs", type=int, default=2)
    arguments.add_argument(
        "--out",
        type=Path,
        help="folder to keep the recordings in; what it has already is only counted",
    )
    options = arguments.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        out = options.out or Path(scratch) / "recordings"
        if not out.exists():
            start = time.perf_counter()
            found = record(
                out, scale=options.scale, seed=options.seed, sites=options.site, jobs=options.jobs
            )
            size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
            print(
                f"{len(found)} recordings, {size / 1e6:.0f} MB in "
                f"{time.perf_counter() - start:.0f} s, {options.jobs} jobs"
            )
        _count(out, Path(scratch))


def _count(out: Path, roads: Path) -> None:
    events: dict[str, Counter[Label]] = defaultdict(Counter)
    recordings: Counter[str] = Counter()
    start = time.perf_counter()
    for source in open_data_set(out, roads=roads).sources:
        recording, name = source.load(), source.path.parent.name
        events[name].update(
            event.label
            for event in label(recording, site_of(source, recording, roads), source.name)
        )
        recordings[name] += 1
    print(f"read and labelled in {time.perf_counter() - start:.0f} s")
    print(f"{'site':<22}{'files':>6}" + "".join(f"{int(one):>7}" for one in CLASSES))
    for name in recordings:
        print(
            f"{name:<22}{recordings[name]:>6}"
            + "".join(f"{events[name][one]:>7}" for one in CLASSES)
        )
    total = sum(events.values(), Counter[Label]())
    print(f"{'all':<22}{recordings.total():>6}" + "".join(f"{total[one]:>7}" for one in CLASSES))


if __name__ == "__main__":
    main()
