"""Take the pictures of results that README.md and docs/replay.md show.

    python docs/screenshot.py [NAME...]

makes docs/replay.png and docs/pictures anew, or those named. Pages are opened in a headless
Chromium (Debian: apt-get install chromium); what commands print is drawn as text.
"""

from __future__ import annotations

import io
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from PIL import Image
from rich.console import Console
from rich.text import Text

import xosc_toolchain as xt
from runner.view.replay.player import write_replay

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / "docs" / "pictures"
_SCENARIO = ROOT / "xosc" / "library" / "highway_lead_brake.xosc"
_MOMENT = "t=5.4&view=chase"
"""Shortly before the contact, in three dimensions"""
_SIZE = (1280, 880)
_COLOURS, _COLUMNS = 96, 100
_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_FLAGS = (
    "--headless",
    "--no-sandbox",
    "--hide-scrollbars",
    "--no-first-run",
    "--disable-background-networking",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)
_SECONDS = 5
"""Time that a page has for drawing, s"""
_SVG = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"
      font-family="monospace" font-size="14">
<rect width="100%" height="100%" rx="8" fill="#161b22"/>
{lines}
</svg>
"""
_LINE = (
    '<text x="16" y="{y}" fill="{colour}" xml:space="preserve" textLength="{length}">{text}</text>'
)
_CHARACTER, _ROW = 8.4, 20


def main(names: Sequence[str]) -> None:
    """Make all pictures, or those named."""
    with tempfile.TemporaryDirectory() as folder:
        for name, make in PICTURE.items():
            if not names or name in names:
                make(Path(folder))


def replay(folder: Path) -> None:
    """A run's page shortly before its contact."""
    page = folder / "replay.html"
    write_replay([xt.run(_SCENARIO, sut="cas", end_after_collision=True)], page)
    _shot(f"{page.as_uri()}#{_MOMENT}", ROOT / "docs" / "replay.png", _SIZE, None)


def catalogue(folder: Path) -> None:
    """The page of a catalogue of the demo's recordings."""
    call(f"xosc-recognize {ROOT}/generation/loop/demo --labels rules --out catalogue", folder)
    _shot((folder / "catalogue" / "index.html").as_uri(), PICTURES / "catalogue.png", (1100, 640))


def search(folder: Path) -> None:
    """The first screen of a search's report."""
    call(
        "xosc-generate cut_in_highway --sut cas --budget 120 --pin "
        "Ego_Speed_mps=36 --out edge_cases",
        folder,
    )
    _shot((folder / "edge_cases" / "report.html").as_uri(), PICTURES / "search.png", (1100, 640))


def report(folder: Path) -> None:
    """The report of a batch that varies a scenario."""
    call(
        "xosc-run simple_cut_in_variation -p CutIn_Speed_mps=12 --sut cas --out varied --replay",
        folder,
    )
    _shot((folder / "varied" / "report.html").as_uri(), PICTURES / "report.png", (1100, 760))


def pair(folder: Path) -> None:
    """Two systems in one scenario, side by side."""
    page = folder / "pair.html"
    write_replay([xt.run(_SCENARIO, sut=sut) for sut in ("adas", "cas")], page)
    _shot(f"{page.as_uri()}#t=5.4", PICTURES / "pair.png", _SIZE)


def explore(folder: Path) -> None:
    """The page of an explored scenario."""
    with _explored(folder, "cut_in_highway --sut adas --world kinematic") as address:
        _shot(f"{address}#t=6.4", PICTURES / "explore.png", (1400, 900))


def check(folder: Path) -> None:
    """The problems of a file with three faults."""
    call("xosc new scenario mine", folder)
    path = folder / "mine.xosc"
    faulty = path.read_text(encoding="utf-8").replace('entityRef="Lead"', 'entityRef="Laed"', 1)
    path.write_text(faulty.replace("rule=", "rul=", 1), encoding="utf-8")
    _print("xosc-check mine.xosc", folder, PICTURES / "check.svg")


def export(folder: Path) -> None:
    """Remarks of an export: what its target changes."""
    _print("xosc-export simple_cut_in --to carla --out for_carla", folder, PICTURES / "export.svg")


PICTURE: dict[str, Callable[[Path], None]] = {
    each.__name__: each
    for each in (replay, check, catalogue, search, report, pair, explore, export)
}


def call(line: str, folder: Path) -> str:
    """Run a command line in a folder, with the programs of this environment; return its output."""
    name, *arguments = shlex.split(line)
    program = Path(sys.executable).with_name(name)
    done = subprocess.run([program, *arguments], cwd=folder, stdout=-1, stderr=-2, text=True)
    return done.stdout


@contextmanager
def _explored(folder: Path, arguments: str) -> Iterator[str]:
    """The address of `xosc explore`, which ends afterwards."""
    program = Path(sys.executable).with_name("xosc")
    command = [program, "explore", *shlex.split(arguments)]
    with subprocess.Popen(command, cwd=folder, stdout=-1, stderr=-3, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.terminate()


def _print(line: str, folder: Path, picture: Path) -> None:
    """Draw a command line and what it prints."""
    lines = [f"$ {line}", *call(line, folder).replace(f"{ROOT}/", "").splitlines()]
    console = Console(width=_COLUMNS, file=io.StringIO())
    wrapped = [str(row).rstrip() for text in lines for row in Text(text).wrap(console, _COLUMNS)]
    drawn = [
        _LINE.format(
            y=_ROW * (row + 1) + 8,
            colour="#7ee787" if text.startswith("$") else "#e6edf3",
            length=round(_CHARACTER * len(text)),
            text=text.replace("&", "&amp;").replace("<", "&lt;"),
        )
        for row, text in enumerate(wrapped)
        if text
    ]
    width, height = round(_CHARACTER * _COLUMNS) + 32, _ROW * (len(wrapped) + 1) + 8
    svg = _SVG.format(width=width, height=height, lines="\n".join(drawn))
    picture.write_text(svg, encoding="utf-8")


def _shot(
    address: str, picture: Path, size: tuple[int, int], colours: int | None = _COLOURS
) -> None:
    """Take a picture of a page, with few colours unless None is given."""
    browser = next((found for name in _BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        sys.exit(f"no browser is installed: {', '.join(_BROWSERS)}")
    with tempfile.TemporaryDirectory() as profile:
        own = (f"--user-data-dir={profile}", "--window-size={},{}".format(*size))
        waits = f"--virtual-time-budget={1000 * _SECONDS}"
        command = [browser, *_FLAGS, *own, waits, f"--screenshot={picture}", address]
        subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    if colours is not None:
        with Image.open(picture) as shot:
            shot.convert("RGB").quantize(colours).save(picture, optimize=True)


if __name__ == "__main__":
    main(sys.argv[1:])
