"""Parameter declarations: their scopes, values and constraints.

Source: OpenSCENARIO XML 1.3.1, section 9.1. The scope of a parameter is the subtree of the element
that declares it; an inner declaration hides an outer one of the same name.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from typing import TYPE_CHECKING, Any

from schemas.common.errors import ToolchainError, nearest
from schemas.common.remarks import Remark, Remarks
from schemas.common.xml import canonical
from schemas.expressions import (
    ExpressionError,
    UnknownParameter,
    evaluate,
    evaluate_columns,
    is_expression,
    is_wellformed,
    references,
    substitute,
)
from schemas.expressions import literal as expression_literal
from schemas.expressions.values import (
    MARK,
    Value,
    holds,
    literal,
    meant,
    number,
    operand,
    quoted,
    type_named,
    typed,
)
from xosc.document.node import Node

if TYPE_CHECKING:
    from schemas.expressions.columns import NumberColumn

TYPED = "asam.net:xosc:1.0.0:parameters.parameter_declaration_parameter_type_inference"
ASSIGNED = "xosc.toolchain:xosc:1.0.0:parameters.assigned_parameter_is_declared"
NUMBERS = "xosc.toolchain:xosc:1.1.0:expressions.expression_has_a_value"
OPERATORS = "asam.net:xosc:1.2.0:data_type.allowed_operators"
"""Rules whose faults are repaired here."""

LONGEST_TEXT = 10_000
"""Characters of texts that are joined; each parameter may double those of the one before"""


@dataclass(frozen=True, slots=True)
class ParameterDeclaration:
    """A declared name with its value.

    Attributes:
        name: its name, without `$`.
        type: one of `schemas.expressions.values.TYPES`.
        value: its value as a Python value.
        text: its value as a literal, as written in attributes.
    """

    name: str
    type: str
    value: Value
    text: str
    column: NumberColumn | None = None
    """its values, in a document that is read for many parameter sets, where they vary"""


class Variable(ParameterDeclaration):
    """A variable with its initial value (1.2 and later)."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Assignment:
    """A value that replaces a parameter's default.

    Attributes:
        text: the value.
        error: makes the error, from its message, that is raised where the value does not fit.
        symbolic: whether the text may refer to parameters of the declaring scope, as a default may.
        remark: makes the remark, from a rule and a message, that is added where the assignment is
            repaired; None where what does not fit is an error.
        column: its values in many parameter sets, of which the text is the first; None for one set.
    """

    text: str
    error: Callable[[str], ToolchainError]
    symbolic: bool = False
    remark: Callable[[str, str], Remark] | None = None
    column: NumberColumn | None = None


class ParameterScope:
    """The parameters that are visible inside one element, all evaluated.

    Args:
        declarations: the ParameterDeclaration elements.
        outer: the scope around, None where there is none.
        assigned: values that replace defaults, by parameter name.
        remarks: where remarks on repairs are added.

    Raises:
        InvalidFile: a declaration is malformed, its value is not of its type, or values depend on
            each other in a circle.
        ToolchainError: an assigned value does not fit, made by its `error`.
    """

    def __init__(
        self,
        declarations: Iterable[Node] = (),
        outer: ParameterScope | None = None,
        assigned: Mapping[str, Assignment] | None = None,
        remarks: Remarks | None = None,
    ) -> None:
        self._remarks = remarks or Remarks()
        # A copy: the scope around may not see what is declared inside.
        self._visible: dict[str, ParameterDeclaration] = dict(outer._visible) if outer else {}
        self._declared: dict[str, Node] = dict(outer._declared) if outer else {}
        self.declarations = _by_name(declarations)
        self._declared |= self.declarations
        assigned = assigned or {}
        for name, assignment in assigned.items():
            if name not in self.declarations:
                message = (
                    f"there is no parameter {quoted(name)} to assign; "
                    f"{nearest(name, self.declarations)}"
                )
                self._repair(assignment, ASSIGNED, message, "it is left out")
        # An inner declaration hides the outer one while its own value is evaluated, too.
        for name in self.declarations:
            self._visible.pop(name, None)
        self._varying = {
            name for name, parameter in self._visible.items() if parameter.column is not None
        }
        sources = {
            name: assigned.get(name)
            or Assignment(node.get("value"), node.invalid, symbolic=True, remark=node.remark)
            for name, node in self.declarations.items()
        }
        # Each after those that its value refers to, whatever their order in the file.
        for name in _in_order(sources):
            self._visible[name] = self._evaluate(name, sources[name])
            if self._visible[name].column is not None:
                self._varying.add(name)

    @property
    def own(self) -> dict[str, ParameterDeclaration]:
        """The parameters declared here, by name, as in the file."""
        return {name: self._visible[name] for name in self.declarations}

    def literal(self, text: str, place: Node | None = None) -> str:
        """An attribute's value with parameters and expressions replaced by their values.

        Args:
            text: the value.
            place: where it stands; texts that are put together in it are repaired with a remark
                there.

        Raises:
            ExpressionError: it refers to an unknown parameter, or has no value.
        """
        if "$" not in text:
            return text
        # A lone reference, the most common value, needs no parser.
        parameter = self._visible.get(text[1:]) if text.startswith("$") else None
        if parameter:
            return parameter.text
        if self._varying and is_expression(text) and references(text) & self._varying:
            return self._in_each_set(text)
        try:
            return substitute(text, self._operand)
        except ExpressionError as error:
            if place is None:
                raise
            named, parts = _referring(text, self._visible), _parts(text)
            # Other tools write names in expressions without `$`: of these only declared ones can be
            # meant.
            if named != text:
                self._remarks.add(
                    place.remark(OPERATORS, f"{error.message}; {quoted(named)} is meant")
                )
                return self.literal(named)
            if not parts:
                raise
            joined = "".join(map(self.literal, parts))
            if len(joined) > LONGEST_TEXT:
                raise ExpressionError(
                    f"a text of {len(joined)} characters is longer than the {LONGEST_TEXT} allowed"
                ) from None
            rule = NUMBERS if is_wellformed(text) else OPERATORS
            self._remarks.add(
                place.remark(rule, f"{error.message}; the texts are joined: {quoted(joined)}")
            )
            return joined

    def _in_each_set(self, text: str) -> str:
        """The mark of an expression's values in many parameter sets."""
        from schemas.expressions.columns import current

        columns = current()
        visible = self._visible
        together = self._together(text)
        # Equal in all sets it is a plain literal, which needs no column.
        if together is not None and (together != together[0]).any():
            return columns.mark(together)

        def of(number: int) -> Value:
            def lookup(name: str) -> float | int | bool | str:
                values = visible[name].column
                return self._operand(name) if values is None else float(values[number])

            return evaluate(text, lookup)

        value = columns.each(of)
        return value if isinstance(value, str) else expression_literal(value)

    def _together(self, text: str) -> Any:
        """Values of an expression in all parameter sets, evaluated at once; None where that is not
        plain arithmetic.

        What is refused in one of the sets is left to the evaluation of each.
        """

        def lookup(name: str) -> Any:
            column = self._visible[name].column
            return self._operand(name) if column is None else column.values

        return evaluate_columns(text, lookup)

    def violations(self) -> Iterator[ToolchainError]:
        """Yield an error for each parameter declared here that violates its constraints.

        Source: ParameterDeclaration.constraintGroups: groups are combined by "or"; the constraints
        of one group by "and".
        """
        for name, declaration in self.declarations.items():
            groups = declaration.children("ConstraintGroup")
            parameter = self._visible[name]
            # All are evaluated: a faulty constraint is refused also where another group holds.
            held = [[self._holds(parameter, item) for item in group.children()] for group in groups]
            if groups and not any(map(all, held)):
                limits = " or ".join(
                    f"({_described(group)})" if len(groups) > 1 else _described(group)
                    for group in groups
                )
                yield declaration.invalid(
                    f"the parameter {name} = {parameter.text} violates its constraint: {limits}"
                )

    def _operand(self, name: str) -> float | int | bool | str:
        """Return the operand of an expression for a parameter; numeric text counts as a number."""
        if name not in self._visible:
            raise UnknownParameter(name, self._visible)
        parameter = self._visible[name]
        if isinstance(parameter.value, str):
            try:
                value = number(parameter.value)
            except ValueError:
                return parameter.value
            declaration = self._declared[name]
            message = (
                f"the text {quoted(parameter.value)} of the parameter {name} is in an expression; "
                "it counts as a number"
            )
            self._remarks.add(declaration.remark(NUMBERS, message))
            return value
        return operand(parameter.value, parameter.text)

    def _evaluate(self, name: str, source: Assignment) -> ParameterDeclaration:
        declaration = self.declarations[name]
        try:
            kind = type_named(self.literal(declaration.get("parameterType")))
        except (ExpressionError, ValueError) as error:
            raise declaration.invalid(f"the type of the parameter {name}: {error}") from None
        try:
            text = (
                self.literal(source.text, declaration if source.remark else None)
                if source.symbolic
                else source.text
            )
        except ExpressionError as error:
            raise source.error(f"the value of the parameter {name}: {error.message}") from None
        if source.column is not None or text.startswith(MARK):
            return _in_many_sets(name, kind, text, source.column)
        try:
            spelled = meant(kind, text)
        except ValueError as error:
            self._repair(
                source, TYPED, f"the value of the parameter {name}: {error}", "it is kept as text"
            )
            # As a text it can still be handed on, as to a controller; where a number is needed the
            # run names it.
            kind, spelled = "string", text
        if spelled != text and source.remark is not None:
            message = (
                f"the value of the parameter {name}: {quoted(text)} is not of type {kind}; "
                f"{spelled} is meant"
            )
            self._remarks.add(source.remark(TYPED, message))
        value = typed(kind, spelled)
        return ParameterDeclaration(name, kind, value, literal(kind, value, spelled))

    def _repair(self, assignment: Assignment, rule: str, fault: str, assumption: str) -> None:
        """Tell a repair, or refuse it where the assignment is not to be repaired."""
        if assignment.remark is None:
            raise assignment.error(fault)
        self._remarks.add(assignment.remark(rule, f"{fault}; {assumption}"))

    def _holds(self, parameter: ParameterDeclaration, constraint: Node) -> bool:
        """Whether one ValueConstraint holds; many sets for which it does not hold as for the first
        are another structure."""
        try:
            text = self.literal(constraint.get("value"))
            if parameter.column is not None or text.startswith(MARK):
                return _hold(parameter, constraint.get("rule"), text)
            limit = typed(parameter.type, meant(parameter.type, text))
            return holds(constraint.get("rule"), parameter.value, limit)
        except (ValueError, ExpressionError) as error:
            raise constraint.invalid(
                f"the constraint of the parameter {parameter.name}: {error}"
            ) from None


def _hold(parameter: ParameterDeclaration, rule: str, text: str) -> bool:
    """Whether a constraint with varying numbers holds for the first set, and so for the sets that
    are alike."""
    from schemas.expressions.columns import current

    columns = current()
    limit: Any = columns.of(text).values if text.startswith(MARK) else number(text)
    value: Any = parameter.value if parameter.column is None else parameter.column.values
    held = holds(rule, value, limit)
    columns.agree(held)
    return bool(held[0])  # type: ignore[index]


def _in_many_sets(
    name: str, kind: str, text: str, column: NumberColumn | None
) -> ParameterDeclaration:
    """A parameter with a value for each set; values that are no doubles are other structures."""
    from schemas.expressions.columns import current

    values = current().of(text) if column is None else column
    if kind == "double":
        return ParameterDeclaration(name, kind, float(values[0]), current().mark(values), values)
    current().agree(values)
    first = expression_literal(float(values[0]))
    return ParameterDeclaration(name, kind, typed(kind, first), first)


def typed_value(node: Node, kind: str, rule: str, remarks: Remarks) -> Value:
    """The attribute `value` of an element as a value of a type; other spellings are read with a
    remark.

    Args:
        rule: uid of the rule that another spelling breaks.

    Raises:
        ValueError: it is no such value.
        InvalidFile: it is missing, or spelled otherwise where remarks are refused.
    """
    text = node.get("value")
    if text.startswith(MARK):
        declared = _in_many_sets("", kind, text, None)
        return declared.value if declared.column is None else declared.column  # type: ignore[return-value]
    spelled = meant(kind, text)
    if spelled != text:
        remarks.add(
            node.remark(rule, f"value={quoted(text)} is not of type {kind}; {spelled} is meant")
        )
    return typed(kind, spelled)


def variables(declarations: Iterable[Node], remarks: Remarks) -> dict[str, Variable]:
    """Variables by name, from VariableDeclaration elements without parameters.

    Args:
        remarks: where remarks on values that are spelled otherwise are added.

    Raises:
        InvalidFile: a declaration is malformed, or its value is not of its type.
    """
    declared: dict[str, Variable] = {}
    for name, declaration in _by_name(declarations).items():
        text = declaration.get("value")
        try:
            kind = type_named(declaration.get("variableType"))
            if text.startswith(MARK):
                varying = _in_many_sets(name, kind, text, None)
                declared[name] = Variable(name, kind, varying.value, varying.text, varying.column)
                continue
            spelled = meant(kind, text)
        except ValueError as error:
            raise declaration.invalid(f"the value of the variable {name}: {error}") from None
        if spelled != text:
            message = (
                f"the value of the variable {name}: {quoted(text)} is not of type {kind}; "
                f"{spelled} is meant"
            )
            remarks.add(declaration.remark(TYPED, message))
        value = typed(kind, spelled)
        declared[name] = Variable(name, kind, value, literal(kind, value, spelled))
    return declared


def monitors(declarations: Iterable[Node]) -> dict[str, bool]:
    """Initial values of monitors by name, from MonitorDeclaration elements without parameters."""
    return {name: declaration.bool("value") for name, declaration in _by_name(declarations).items()}


def _by_name(declarations: Iterable[Node]) -> dict[str, Node]:
    by_name: dict[str, Node] = {}
    for declaration in declarations:
        name = declaration.get("name")
        if "$" in name:
            raise declaration.invalid(
                f"the declared name {quoted(name)} must be written without '$'"
            )
        # Files repeat declarations; two that say the same leave nothing open.
        first = by_name.get(name)
        if first and canonical(first.element) != canonical(declaration.element):
            raise declaration.invalid(
                f"{quoted(name)} is declared twice and differently, first in line {first.line}"
            )
        by_name[name] = declaration
    return by_name


def _in_order(sources: Mapping[str, Assignment]) -> list[str]:
    """Names in an order in which each value refers to earlier names only."""
    # Without references any order will do.
    if not any(source.symbolic and "$" in source.text for source in sources.values()):
        return list(sources)
    sorter: TopologicalSorter[str] = TopologicalSorter()
    for name, source in sources.items():
        try:
            used = (
                {name for part in _parts(source.text) or [source.text] for name in references(part)}
                if source.symbolic
                else set()
            )
            # Sorted: sets of texts have another order in each process.
            sorter.add(name, *sorted(used & sources.keys()))
        except ExpressionError as error:
            raise source.error(f"the value of the parameter {name}: {error.message}") from None
    try:
        return list(sorter.static_order())
    except CycleError as error:
        circle = list(reversed(error.args[1]))
        # At one parameter of the circle: each of the others depends on itself as well.
        raise sources[circle[0]].error(
            f"the parameter {circle[0]} depends on itself: {' → '.join(circle)}"
        ) from None


def _described(group: Node) -> str:
    return " and ".join(f"{item.get('rule')} {item.get('value')}" for item in group.children())


# Expressions that other tools write: texts put together in `${}`, for which the standard has no
# operator, and names without `$`.

_OPERAND = r"(?:\$[A-Za-z_]\w*|'[^']*')"
_SUM = re.compile(rf"\$\{{\s*{_OPERAND}(?:\s*\+\s*{_OPERAND})*\s*\}}", re.ASCII)
_EXPRESSION = re.compile(r"(\$\{[^{}]*\})")
_NAME = re.compile(r"(?<![\w$.'])[A-Za-z_]\w*\b(?!\s*\()", re.ASCII)


def _parts(text: str) -> list[str]:
    """The texts, references and expressions that a value is put together of; empty for anything
    else.

    These are sums of parameters and quoted texts (`${$town + '_day'}`), and expressions with text
    between them (`${$town}_${$hour}`).
    """
    if _SUM.fullmatch(text):
        return [operand.strip("'") for operand in re.findall(_OPERAND, text, re.ASCII)]
    # Three parts are one expression between empty texts.
    between = _EXPRESSION.split(text)
    return between if len(between) > 3 else []


def _referring(text: str, names: Container[str]) -> str:
    """A value with `$` before the names in its expressions, of those given: parameters that are
    meant."""

    def named(expression: re.Match[str]) -> str:
        return _NAME.sub(lambda name: f"${name[0]}" if name[0] in names else name[0], expression[0])

    return _EXPRESSION.sub(named, text)
