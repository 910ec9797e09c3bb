"""Aspects of traffic lights: the meaning of the states that scenarios write.

The standard leaves it to the road network how a state is written. Understood are, whatever the case
of letters:

| state | aspect |
|---|---|
| colours (`red`, `Red_Yellow`, `amber`, `green`) | these |
| `flashing yellow`, `yellow blinking` | flashing yellow |
| three lamps from top to bottom (`on;off;off`) | red, yellow, green, whichever are lit |
| two lamps from top to bottom (`off;on`) | red, green |
| `stop`, `go`, `caution`, `attention_go`, `attention_stop`, `fallback` | those
of the semantics below |
| `off`, `dark`, `none`, `inactive`, `disabled`, nothing | off |

Where a phase has `semantics` (since 1.4), these decide: `stop` is red, `attention_go` red and
yellow, `go` green, `attention_stop` yellow, `caution` flashing yellow, `fallback` off.
"""

from __future__ import annotations

import re
from enum import StrEnum


class Aspect(StrEnum):
    """Aspect of a light, by the lamps that are lit."""

    RED = "red"
    RED_YELLOW = "red yellow"
    YELLOW = "yellow"
    GREEN = "green"
    CAUTION = "flashing yellow"
    OFF = "off"


SEMANTICS = {
    "stop": Aspect.RED, "attention_go": Aspect.RED_YELLOW, "go": Aspect.GREEN,
    "attention_stop": Aspect.YELLOW,
    "caution": Aspect.CAUTION, "fallback": Aspect.OFF,
}  # fmt: skip
"""Aspect by the semantics of a phase."""
STOPS = frozenset({Aspect.RED, Aspect.RED_YELLOW})
"""Aspects at which no vehicle may pass; at yellow those may that cannot stop any more."""

_COLOURS = re.compile("red|yellow|amber|orange|green")
_LAMPS = {3: ("red", "yellow", "green"), 2: ("red", "green")}
_NAMES = {"amber": "yellow", "orange": "yellow"}
_LIT = {
    frozenset({"red"}): Aspect.RED,
    frozenset({"red", "yellow"}): Aspect.RED_YELLOW,
    frozenset({"yellow"}): Aspect.YELLOW,
    frozenset({"green"}): Aspect.GREEN,
    frozenset({"yellow", "green"}): Aspect.YELLOW,
}
_DARK = frozenset({"", "off", "dark", "none", "inactive", "disabled"})


def aspect_of(state: str) -> Aspect | None:
    """Aspect of a light in a state as scenarios write it; None where it is not understood."""
    text = state.strip().lower()
    if text in SEMANTICS:
        return SEMANTICS[text]
    lamps = [lamp.strip() for lamp in text.split(";")]
    flashing = "flash" in text or "blink" in text
    if len(lamps) in _LAMPS and all(
        lamp in ("on", "off", "flashing", "blinking") for lamp in lamps
    ):
        lit = frozenset(
            colour for colour, lamp in zip(_LAMPS[len(lamps)], lamps, strict=True) if lamp != "off"
        )
    else:
        lit = frozenset(_NAMES.get(colour, colour) for colour in _COLOURS.findall(text))
        if not lit and text not in _DARK:
            return None
    if not lit:
        return Aspect.OFF
    aspect = _LIT.get(lit)
    return Aspect.CAUTION if flashing and aspect is Aspect.YELLOW else aspect
