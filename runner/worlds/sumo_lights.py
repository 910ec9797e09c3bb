"""What the state of a traffic signal means to SUMO's traffic.

The standard leaves it to the road network how a state is written. Two ways of writing are in use and understood here: colours
(`red`, `redYellow`, `GREEN`), and the lamps from top to bottom (`on;off;off`, `flashing` too), of which three are red,
yellow and green, and two are red and green.
"""

from __future__ import annotations

import re

RED, RED_YELLOW, YELLOW, GREEN, YIELD, OFF = "r", "u", "y", "g", "o", ""
"""Link states of SUMO. OFF is not SUMO's: the junction's own right of way holds, for which SUMO has one or another letter."""

_COLOURS = re.compile("red|yellow|amber|orange|green")
_LAMPS = {3: ("red", "yellow", "green"), 2: ("red", "green")}
_NAMES = {"amber": "yellow", "orange": "yellow"}
_MEANINGS = {
    frozenset({"red"}): RED,
    frozenset({"red", "yellow"}): RED_YELLOW,
    frozenset({"yellow"}): YELLOW,
    frozenset({"green"}): GREEN,
    frozenset({"yellow", "green"}): YELLOW,
}
_DARK = frozenset({"", "off", "dark", "none", "inactive", "disabled"})


def link_state(state: str) -> str | None:
    """SUMO's link state of a signal's state; None where it is not understood."""
    text = state.strip().lower()
    lamps = [lamp.strip() for lamp in text.split(";")]
    flashing = "flash" in text or "blink" in text
    if len(lamps) in _LAMPS and all(lamp in ("on", "off", "flashing", "blinking") for lamp in lamps):
        lit = frozenset(colour for colour, lamp in zip(_LAMPS[len(lamps)], lamps, strict=True) if lamp != "off")
    else:
        lit = frozenset(_NAMES.get(colour, colour) for colour in _COLOURS.findall(text))
        if not lit and text not in _DARK:
            return None
    if not lit:
        return OFF
    meaning = _MEANINGS.get(lit)
    return YIELD if flashing and meaning == YELLOW else meaning
