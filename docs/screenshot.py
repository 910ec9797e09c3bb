"""Take the picture of a replay that docs/replay.md shows.

    python docs/screenshot.py

runs highway_lead_brake with `cas`, opens its page in a headless Chromium (Debian: apt-get install
chromium), and makes docs/replay.png anew.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import xosc_toolchain as xt
from runner.view.replay.player import write_replay

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs" / "replay.png"
_SCENARIO = ROOT / "xosc" / "library" / "highway_lead_brake.xosc"
_MOMENT = "t=5.4&view=chase"
"""Shortly before the contact, in three dimensions"""
_SIZE = "1280,880"
_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_FLAGS = (
    "--headless",
    "--no-sandbox",
    "--hide-scrollbars",
    "--no-first-run",
    "--disable-background-networking",
)
_GRAPHICS = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
_SECONDS = 5
"""Time that the page has for drawing, s"""


def main() -> None:
    """Run, write the page, take the picture."""
    browser = next((found for name in _BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        sys.exit(f"no browser is installed: {', '.join(_BROWSERS)}")
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "replay.html"
        write_replay([xt.run(_SCENARIO, sut="cas", end_after_collision=True)], page)
        own = (
            f"--user-data-dir={folder}/profile",
            f"--window-size={_SIZE}",
            f"--screenshot={PICTURE}",
        )
        waits = f"--virtual-time-budget={1000 * _SECONDS}"
        subprocess.run(
            [browser, *_FLAGS, *_GRAPHICS, *own, waits, f"{page.as_uri()}#{_MOMENT}"],
            check=True,
            stderr=subprocess.DEVNULL,
        )


if __name__ == "__main__":
    main()
