"""Expressions that others write: texts put together in `${}`, for which the standard has no operator, and names without `$`."""

from __future__ import annotations

import re
from collections.abc import Container

_OPERAND = r"(?:\$[A-Za-z_]\w*|'[^']*')"
_SUM = re.compile(rf"\$\{{\s*{_OPERAND}(?:\s*\+\s*{_OPERAND})*\s*\}}", re.ASCII)
_EXPRESSION = re.compile(r"(\$\{[^{}]*\})")
_NAME = re.compile(r"(?<![\w$.'])[A-Za-z_]\w*\b(?!\s*\()", re.ASCII)


def parts(text: str) -> list[str]:
    """The texts, references and expressions that a value is put together of; empty for anything else.

    These are sums of parameters and quoted texts (`${$town + '_day'}`), and expressions with text between them
    (`${$town}_${$hour}`).
    """
    if _SUM.fullmatch(text):
        return [each.strip("'") for each in re.findall(_OPERAND, text, re.ASCII)]
    between = _EXPRESSION.split(text)
    return between if len(between) > 3 else []


def referring(text: str, names: Container[str]) -> str:
    """A value with `$` before the names in its expressions, of those given: parameters that are meant."""

    def named(expression: re.Match[str]) -> str:
        return _NAME.sub(lambda name: f"${name[0]}" if name[0] in names else name[0], expression[0])

    return _EXPRESSION.sub(named, text)
