"""Texts that are put together in `${}`, for which the standard's expressions have no operator."""

from __future__ import annotations

import re

_OPERAND = r"(?:\$[A-Za-z_]\w*|'[^']*')"
_SUM = re.compile(rf"\$\{{\s*{_OPERAND}(?:\s*\+\s*{_OPERAND})*\s*\}}", re.ASCII)
_EXPRESSION = re.compile(r"(\$\{[^{}]*\})")


def parts(text: str) -> list[str]:
    """The texts, references and expressions that a value is put together of; empty for anything else.

    These are sums of parameters and quoted texts (`${$town + '_day'}`), and expressions with text between them
    (`${$town}_${$hour}`).
    """
    if _SUM.fullmatch(text):
        return [each.strip("'") for each in re.findall(_OPERAND, text, re.ASCII)]
    between = _EXPRESSION.split(text)
    return between if len(between) > 3 else []
