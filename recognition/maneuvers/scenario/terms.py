"""Terms of the parameters that follow from them: when the manoeuvre begins, and the gap at its trigger.

The gap at the trigger and the time until then over-determine the start (METHOD.md §3). Everyone keeps a speed until then, and
where the leader in the ego's own lane is the faster one, the time is cut to what leaves a gap between them at the start.
Terms are parts of expressions, without the ${ } around.
"""

from __future__ import annotations

from xosc.versions import Version

APART = 2.0
"""Gap (m) at the scene's start between two in one lane, at least"""
STILL = 0.001
"""Least speed (m/s) to divide by"""
_REACHED = 0.5
"""How much longer than the parameter the gap (m) may be when the manoeuvre begins: it is looked at once a step"""
_ANY = 1000.0
"""A gap (m) that is never exceeded"""
_MIN_MAX = (1, 3)
"""First version of the standard with min(), max() and sign() in expressions"""


def approach(start_time: str, gap: str, opening: str, version: Version = _MIN_MAX) -> str:
    """Time until the manoeuvre begins, of two in one lane that move apart by a speed: the start time, cut as said above."""
    return lesser(start_time, f"{greater(f'{gap} - {APART}', '0', version)} / {greater(opening, str(STILL), version)}", version)


def trigger_gap(gap: str, opening: str | None = None, version: Version = _MIN_MAX) -> str:
    """The longest gap at which the manoeuvre begins; any, where the gap grows: it has been reached if the ego was late."""
    if opening is None:
        return f"{gap} + {_REACHED}"
    sign = f"sign({opening})" if version >= _MIN_MAX else f"{opening} / (sqrt(pow({opening}, 2)) + {STILL})"
    return f"{gap} + {_REACHED} + {_ANY} * {greater(sign, '0', version)}"


def lesser(a: str, b: str, version: Version = _MIN_MAX) -> str:
    """The lesser of two terms."""
    return f"min({a}, {b})" if version >= _MIN_MAX else f"((({a}) + ({b}) - sqrt(pow(({a}) - ({b}), 2))) / 2)"


def greater(a: str, b: str, version: Version = _MIN_MAX) -> str:
    """The greater of two terms."""
    return f"max({a}, {b})" if version >= _MIN_MAX else f"((({a}) + ({b}) + sqrt(pow(({a}) - ({b}), 2))) / 2)"
