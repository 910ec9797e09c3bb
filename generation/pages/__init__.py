"""Shared parts of generation's pages, beyond those of all pages (`runner.replay.page`)."""

from pathlib import Path

_FOLDER = Path(__file__).parent
PARTS_JS, PARTS_CSS = (str(_FOLDER / f"parts.{kind}") for kind in ("js", "css"))
"""Files of counts, links, buttons and tables, for `runner.replay.page.page`"""
