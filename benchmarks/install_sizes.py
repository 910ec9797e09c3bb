"""Sizes of what pip downloads for the package and its extras, in an environment that has nothing.

    python -m benchmarks.install_sizes [EXTRA...]

asks pip what it would install for `.` and each extra (search and recognition by default), on this
machine and with pip's own indexes, and adds up the sizes of these files. Installed they take about
three times as much.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from urllib.parse import unquote, urlsplit
from urllib.request import Request, urlopen

ROOT = Path(__file__).resolve().parents[1]
_MB = 1e6
_SHOWN = 3


def main() -> None:
    """Print a line for the package and one for each extra."""
    for extra in ("", *(sys.argv[1:] or ("search", "recognition"))):
        sizes = {name: size(address) for name, address in files(extra).items()}
        largest = sorted(sizes.items(), key=lambda item: -item[1])[:_SHOWN]
        named = ", ".join(f"{name} {count / _MB:.0f}" for name, count in largest)
        print(
            f"{extra or 'the package'}: {len(sizes)} files, "
            f"{sum(sizes.values()) / _MB:.0f} MB ({named})"
        )


def files(extra: str) -> dict[str, str]:
    """Addresses of the files that pip would install, by package, without this package itself."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        options = ("--quiet", "--dry-run", "--ignore-installed", "--report", str(report))
        command = [
            sys.executable,
            "-m",
            "pip",
            "install",
            *options,
            f".[{extra}]" if extra else ".",
        ]
        subprocess.run(command, cwd=ROOT, check=True)
        listed = json.loads(report.read_text(encoding="utf-8"))["install"]
    return {
        each["metadata"]["name"]: each["download_info"]["url"]
        for each in listed
        if "dir_info" not in each["download_info"]
    }


def size(address: str) -> int:
    """Bytes of a file."""
    place = urlsplit(address)
    if place.scheme == "file":
        return Path(unquote(place.path)).stat().st_size
    with urlopen(Request(address, method="HEAD"), timeout=60) as answer:
        return int(answer.headers["Content-Length"])


if __name__ == "__main__":
    main()
