"""Questions to rows of catalogues, batches and searches: conditions, order, near-duplicates,
similar scenarios.

Conditions are parsed here and become expressions of pyarrow: nothing in them is executed.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from schemas.common.errors import InvalidFile, UsageError, like_or_nearest
from xosc.document import load
from xosc.listing.tables import BATCH, Index, column_hint
from xosc.writing.tags import tags_of

if TYPE_CHECKING:
    import numpy as np
    import pyarrow as pa
    import pyarrow.compute as pc

_LONGEST, _DEEPEST = 4000, 40
"""Characters of a condition, and brackets in each other, at most"""
_SPEEDS = {"km/h": 1.0 / 3.6, "mph": 0.44704, "m/s": 1.0}
"""Units of speed that may follow a number, in that of columns"""
_TOKEN = re.compile(
    r"(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?:\s*(?:km/h|mph|m/s)(?!\w))?)|(?P<text>'(?:[^']|'')*'|\"(?:[^\"]|\"\")*\")"
    r"|(?P<name>[A-Za-z_]\w*)|(?P<sign><=|>=|<>|!=|==|=|<|>|\(|\)|,)"
)
_WORDS = frozenset(("and", "or", "not", "between", "in", "is", "null", "like", "true", "false"))
_SIGNS: dict[str, Callable[[Any, Any], Any]] = {
    "=": lambda a, b: a == b, "==": lambda a, b: a == b, "!=": lambda a, b: a != b, "<>": lambda a,
    b: a != b,
    "<": lambda a, b: a < b, "<=": lambda a, b: a <= b, ">": lambda a, b: a > b, ">=": lambda a,
    b: a >= b,
}  # fmt: skip
_ORDERED = ("<", "<=", ">", ">=")
_COMPARISONS = "=, !=, <, <=, >, >=, between, in, like, is null"


class Question(NamedTuple):
    """Condition on the rows of an index, the columns it names, and the texts that columns equal."""

    expression: pc.Expression
    columns: list[str]
    texts: list[tuple[str, str]]

    def missing(self, table: pa.Table) -> str:
        """Return the hint about the first text that no row of a table has; empty without one."""
        for column, text in self.texts:
            there = sorted(value for value in table[column].unique().to_pylist() if value)
            if text not in there:
                return f"no row has {column} {text!r}; {like_or_nearest(text, there)}"
        return ""


def condition(text: str, schema: pa.Schema) -> Question:
    """Return the condition that a text states on rows of a schema.

    Columns, numbers (speeds also as `100 km/h`), texts in quotes, `true` and `false` are compared
    by =, !=, <, <=, >, >=, `between … and …`, `in (…)`, `like '…%'` and `is [not] null`, and joined
    by `and`, `or`, `not` and brackets. Absent values match `is null` alone.

    Raises:
        UsageError: the text is no such condition, names an unknown column or compares different
            types; with the position.
    """
    return _ConditionParser(text, schema).parsed()


class _Token(NamedTuple):
    """Piece of a condition: its kind (`number`, `text`, `name`, `word`, `sign`, `end`), text, and
    position from 1."""

    kind: str
    text: str
    at: int


class _Operand(NamedTuple):
    """Column or literal: its expression, its type (`number`, `text`, `truth`), and its token."""

    expression: Any
    type: str
    token: _Token


class _ConditionParser:
    """Recursive descent over the tokens of a condition."""

    def __init__(self, text: str, schema: pa.Schema) -> None:
        self._schema, self._next, self._depth = schema, 0, 0
        self._columns: dict[str, None] = {}
        self._texts: list[tuple[str, str]] = []
        # Before it is read: a condition may come from a service.
        if len(text) > _LONGEST:
            raise UsageError(f"a condition has at most {_LONGEST} characters, not {len(text)}")
        self._tokens = list(self._read(text))

    def parsed(self) -> Question:
        """Return the condition."""
        whole = self._any()
        if self._here.kind != "end":
            raise self._wrong(self._here, "'and', 'or' or the end is expected")
        return Question(whole, list(self._columns), self._texts)

    def _read(self, text: str) -> list[_Token]:
        tokens, at = list[_Token](), 0
        while at < len(text):
            if text[at].isspace():
                at += 1
                continue
            match = _TOKEN.match(text, at)
            if match is None:
                what = (
                    "this text has no closing quote"
                    if text[at] in "'\""
                    else "this is no part of a condition"
                )
                raise self._wrong(_Token("", text[at : at + 12], at + 1), what)
            kind, piece = str(match.lastgroup), match[0]
            # A column may have the name of a word: then it is the column.
            word = kind == "name" and piece.lower() in _WORDS and piece not in self._schema.names
            tokens.append(
                _Token("word", piece.lower(), at + 1) if word else _Token(kind, piece, at + 1)
            )
            at = match.end()
        return [*tokens, _Token("end", "the end", len(text) + 1)]

    @property
    def _here(self) -> _Token:
        return self._tokens[self._next]

    def _take(self, kind: str, *texts: str) -> _Token | None:
        """Step over the next token if it is of a kind and, where given, one of some texts."""
        token = self._here
        if token.kind != kind or (texts and token.text not in texts):
            return None
        self._next += 1
        return token

    def _need(self, kind: str, text: str) -> None:
        if self._take(kind, text) is None:
            raise self._wrong(self._here, f"{text!r} is expected")

    def _wrong(self, token: _Token, why: str) -> UsageError:
        return UsageError(f"condition, position {token.at} ({token.text}): {why}")

    def _any(self) -> Any:
        # `and` binds before `or`, `not` before both, as in SQL.
        either = self._all()
        while self._take("word", "or"):
            either = either | self._all()
        return either

    def _all(self) -> Any:
        both = self._negated()
        while self._take("word", "and"):
            both = both & self._negated()
        return both

    def _negated(self) -> Any:
        # A loop, since a recursion would be as deep as there are words `not`.
        inverted = False
        while self._take("word", "not"):
            inverted = not inverted
        term = self._one()
        return ~term if inverted else term

    def _one(self) -> Any:
        if bracket := self._take("sign", "("):
            self._depth += 1
            # Each bracket is a recursion of four functions: Python's own limit would end in a
            # traceback.
            if self._depth > _DEEPEST:
                raise self._wrong(bracket, f"more than {_DEEPEST} brackets in each other")
            inside = self._any()
            self._need("sign", ")")
            self._depth -= 1
            return inside
        return self._comparison(self._operand())

    def _comparison(self, left: _Operand) -> Any:
        if sign := self._take("sign", *_SIGNS):
            return self._compared(left, sign, self._operand())
        if self._take("word", "is"):
            inverted = self._take("word", "not")
            self._need("word", "null")
            return ~left.expression.is_null() if inverted else left.expression.is_null()
        inverted, at = self._take("word", "not"), self._here
        if self._take("word", "between"):
            # The `and` of `between` belongs to it: it is taken here, before one that joins
            # conditions.
            low = self._compared(left, at._replace(text=">="), self._operand())
            self._need("word", "and")
            comparison = low & self._compared(left, at._replace(text="<="), self._operand())
        elif self._take("word", "in"):
            comparison = self._listed(left)
        elif self._take("word", "like"):
            comparison = self._alike(left, at)
        elif left.type == "truth" and inverted is None:
            return left.expression
        else:
            raise self._wrong(at, f"a comparison is expected: {_COMPARISONS}")
        # Of absent values `not` gives an absent truth, which no row passes: as in SQL.
        return ~comparison if inverted else comparison

    def _listed(self, left: _Operand) -> Any:
        self._need("sign", "(")
        equals = _Token("sign", "=", self._here.at)
        # Comparisons, not `is_in`: types and the hint on unknown texts are the same as of `=`.
        any_of = self._compared(left, equals, self._operand())
        while self._take("sign", ","):
            any_of = any_of | self._compared(left, equals, self._operand())
        self._need("sign", ")")
        return any_of

    def _alike(self, left: _Operand, at: _Token) -> Any:
        import pyarrow.compute as pc

        pattern = self._take("text")
        if left.type != "text" or pattern is None:
            raise self._wrong(
                at if pattern else self._here,
                "'like' compares a column of texts with a text: site like 'US-101%'",
            )
        return pc.match_like(left.expression, _unquoted(pattern.text))

    def _compared(self, left: _Operand, sign: _Token, right: _Operand) -> Any:
        if left.type != right.type:
            raise self._wrong(
                right.token, f"{left.token.text} is a {left.type}, this is a {right.type}"
            )
        if left.type == "truth" and sign.text in _ORDERED:
            raise self._wrong(sign, f"{left.token.text} is true or false and has no order")
        # Kept for the hint alone, which is told where no row is left.
        if sign.text in ("=", "==") and (left.token.kind, right.token.kind) == ("name", "text"):
            self._texts.append((left.token.text, _unquoted(right.token.text)))
        return _SIGNS[sign.text](left.expression, right.expression)

    def _operand(self) -> _Operand:
        import pyarrow.compute as pc

        token = self._here
        # Not beyond the end, which messages still need as a place.
        self._next += token.kind != "end"
        if token.kind == "number":
            return _Operand(pc.scalar(_number(token.text)), "number", token)
        if token.kind == "text":
            return _Operand(pc.scalar(_unquoted(token.text)), "text", token)
        if token.text in ("true", "false") and token.kind == "word":
            return _Operand(pc.scalar(token.text == "true"), "truth", token)
        if token.kind != "name":
            raise self._wrong(token, "a column, a number or a text in quotes is expected")
        kind = _type_of(self._schema, token.text)
        if kind is None:
            raise self._wrong(
                token, f"there is no such column; {column_hint(token.text, self._schema.names)}"
            )
        self._columns[token.text] = None
        return _Operand(pc.field(token.text), kind, token)


def _number(text: str) -> float:
    """A number, in m/s where it is followed by a unit of speed."""
    unit = next((name for name in _SPEEDS if text.endswith(name)), "")
    # Columns have SI units; a number without a unit is taken as it is.
    return float(text.removesuffix(unit)) * _SPEEDS.get(unit, 1.0)


def _unquoted(text: str) -> str:
    return text[1:-1].replace(text[0] * 2, text[0])


def _type_of(schema: pa.Schema, name: str) -> str | None:
    """Type of a column as conditions have it; None for an absent column."""
    import pyarrow as pa

    if name not in schema.names:
        return None
    kind = schema.field(name).type
    return (
        "truth" if pa.types.is_boolean(kind) else "text" if pa.types.is_string(kind) else "number"
    )


def ordered(table: pa.Table, names: Sequence[str]) -> pa.Table:
    """Return the rows in the order of columns, `-name` for descending; absent values last, equal
    rows by batch, file and name.

    Raises:
        UsageError: there is no such column.
    """
    keys = []
    for name in names:
        column = name.removeprefix("-")
        if column not in table.column_names:
            raise UsageError(
                f"--sort: there is no column {column!r}; {column_hint(column, table.column_names)}"
            )
        keys.append((column, "descending" if name.startswith("-") else "ascending"))
    # Rows of equal values in one order, whatever order threads have read them in.
    last = [(name, "ascending") for name in (BATCH, "file", "name") if name in table.column_names]
    return table.sort_by([*keys, *last]) if keys or last else table


SCALES = {
    "ego_speed": 2.0, "partner_speed": 2.0, "closing_speed": 1.0, "gap": 5.0, "pair_thw": 0.5,
    "pair_ttc": 1.0, "pair_drac": 0.5,
    "limit": 3.0, "min_distance": 2.0,
}  # fmt: skip
"""Difference in each column that counts as distance 1: m/s, m, s, m/s²"""
_ALIKE = ("class", "road_kind", "light")
"""Columns whose difference counts as `_LACKING`"""
_LACKING = 3.0
"""Distance of a value from an absent one, and greatest distance in one column"""
NEAR = 0.25
"""Greatest distance of near-duplicates"""


def distance(table: pa.Table, one: dict[str, Any]) -> np.ndarray:
    """Return the distance (n,) of all rows from a scenario.

    Root mean square over the columns of `SCALES` of the differences divided by these, 3 at most,
    and 3 where one value is absent; class, road kind and light count 3 where they differ. Columns
    in which both are absent do not count.

    Args:
        one: values by column; absent ones are None.
    """
    features = _features([*table.to_pylist(), one])
    return _distances(features[:-1], features[-1])


def _features(rows: Sequence[dict[str, Any]]) -> np.ndarray:
    """Values (n, k) in units of their scales, NaN for absent ones; names as numbers that differ by
    `_LACKING`."""
    import numpy as np

    columns = [
        np.array([row.get(name) for row in rows], np.float64) / scale
        for name, scale in SCALES.items()
    ]
    for name in _ALIKE:
        values = [row.get(name) for row in rows]
        # Two unlike names differ by the greatest distance or a multiple of it, which is cut to it.
        codes = {
            value: _LACKING * code
            for code, value in enumerate(sorted({str(value) for value in values}))
        }
        columns.append(
            np.array([np.nan if value is None else codes[str(value)] for value in values])
        )
    return np.stack(columns, axis=1)


def _distances(features: np.ndarray, one: np.ndarray) -> np.ndarray:
    import numpy as np

    absent, missing = np.isnan(features), np.isnan(one)
    # NaN where a value is absent: no difference where both are, the greatest where one is.
    differs = np.minimum(np.nan_to_num(np.abs(features - one)), _LACKING)
    differs[absent != missing] = _LACKING
    return np.asarray(
        np.sqrt(np.square(differs).sum(axis=1) / np.maximum((~(absent & missing)).sum(axis=1), 1))
    )


def distinct(table: pa.Table) -> pa.Table:
    """Return the rows without near-duplicates; the column `duplicates` names the ones left out for
    each.

    A row is a near-duplicate of the first row before it at a distance of `NEAR` or less.
    """
    import numpy as np
    import pyarrow as pa

    files, features = table["file"].to_pylist(), _features(table.to_pylist())
    # From the first row on: an order by the user decides which of alike rows stands for the others.
    left, named = np.arange(table.num_rows), dict[int, list[str]]()
    while len(left):
        near = _distances(features[left], features[left[0]]) <= NEAR
        named[int(left[0])] = [files[row] for row in left[near][1:].tolist()]
        left = left[~near]
    kept = list(named)
    return table.take(pa.array(kept, pa.int64())).append_column(
        "duplicates", pa.array(["; ".join(named[row]) for row in kept])
    )


def similar(index: Index, file: Path) -> pa.Table:
    """Return the rows by their distance from a scenario, nearest first, with the column `distance`;
    the scenario is left out.

    Args:
        file: a scenario of this catalogue, or any other with the tags that `xosc-recognize` writes.

    Raises:
        InvalidFile: the file is not readable, or has none of the features.
    """
    import pyarrow as pa

    files, path = index.table["file"].to_pylist(), Path(os.path.abspath(file))
    own = [
        row for row, name in enumerate(files) if Path(os.path.abspath(index.root / name)) == path
    ]
    one = index.table.take(own).to_pylist()[0] if own else _tagged(file)
    table = index.table.append_column("distance", pa.array(distance(index.table, one).round(3)))
    others = pa.array([row for row in range(len(files)) if row not in own], pa.int64())
    return table.take(others).sort_by([("distance", "ascending"), ("file", "ascending")])


def _tagged(file: Path) -> dict[str, Any]:
    """Features of a scenario by its tags."""
    # For its error alone: tags of a file that is no scenario would only seem absent.
    load(file)
    # Tags are `EgoSpeed`, columns `ego_speed`.
    tags = {re.sub(r"(?<!^)(?=[A-Z])", "_", tag.type).lower(): tag.value for tag in tags_of(file)}
    one: dict[str, Any] = {name: tags[name] for name in _ALIKE if isinstance(tags.get(name), str)}
    for name in SCALES:
        try:
            one[name] = float(str(tags[name]))
        except (KeyError, ValueError):
            continue
    # Classes alone make everything of one class equally near.
    if not one.keys() & SCALES.keys():
        raise InvalidFile(f"no tag has a feature to compare: {', '.join(SCALES)}", path=file)
    return one
