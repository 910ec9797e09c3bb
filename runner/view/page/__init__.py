"""HTML pages made of the files beside this module: self-contained files that need no network."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from schemas.common.storage import keep

_FOLDER = Path(__file__).parent
_UNSAFE = {ord(c): f"\\u{ord(c):04x}" for c in "<>&\u2028\u2029"}
"""Characters that could end a script element; JSON knows another spelling of each"""
_COMMENT = re.compile(r"/\*\*.*?\*/", re.DOTALL)
# Scenarios may come from anybody: whatever their texts hold, a page sends nothing anywhere.
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; base-uri 'none'; "
    "form-action 'none'"
)


_SERVED = "; connect-src 'self'; frame-src 'self'"
"""Additions for a page that asks the server which it comes from"""


def page(
    title: str,
    styles: Sequence[str],
    scripts: Sequence[str],
    data: Mapping[str, Any],
    *,
    served: bool = False,
) -> str:
    """A whole page.

    Args:
        title: any text.
        styles, scripts: files beside this module; scripts share one scope and run in this order.
        data: what the scripts find in the element `data`, JSON-able.
        served: whether it may ask its own server, and show pages of that.
    """
    # NaN is no JSON: the page could not be read.
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":")).translate(
        _UNSAFE
    )
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}{_SERVED if served else ""}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{html.escape(title)}</title>
<style>
{_joined(styles)}</style>
</head>
<body>
<noscript>This page plays a recorded run and needs JavaScript; it loads nothing from
anywhere.</noscript>
<script type="application/json" id="data">{text}</script>
<script>
"use strict";
(() => {{
{_joined(scripts)}}})();
</script>
</body>
</html>
"""


def write_page(path: Path, text: str) -> None:
    """Write a page as UTF-8, whole or not at all; characters that are none (of file names) are
    replaced."""
    keep(
        text.encode("utf-8", errors="replace"), path
    )  # a link that bears its name is replaced, not followed


def _joined(files: Sequence[str]) -> str:
    """Concatenated files, without comments and indentation."""
    whole = "".join((_FOLDER / name).read_text(encoding="utf-8") for name in files)
    lines = map(str.strip, _COMMENT.sub("", whole).splitlines())
    return "".join(f"{line}\n" for line in lines if line and not line.startswith("//"))
