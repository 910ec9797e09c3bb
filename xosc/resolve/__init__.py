"""Resolving a document: every attribute a literal, every catalogue reference replaced by what it
stands for.

Modules:

- `parameters`: parameter declarations: their scopes, values and constraints

Example::

    xosc.resolve(xosc.load("mine.xosc"), {"speed": 20.0})
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, cast

from lxml import etree

from schemas.catalogs import (
    ENTRIES,
    EXPECTED,
    REFERENCES,
    CatalogEntry,
    Catalogs,
    Directory,
    Folders,
    NoEntry,
)
from schemas.common.errors import ToolchainError, UsageError
from schemas.common.remarks import Remark, Remarks, with_ignored
from schemas.expressions import ExpressionError, is_expression
from schemas.expressions.values import quoted
from xosc.document import Document, load
from xosc.document.carla import is_for_carla, is_mirrored, to_standard
from xosc.document.node import LINE, SOURCE, Node
from xosc.document.repairs import attributes
from xosc.resolve.parameters import (
    OPERATORS,
    Assignment,
    ParameterDeclaration,
    ParameterScope,
    Variable,
    monitors,
    variables,
)

if TYPE_CHECKING:
    from schemas.expressions.columns import NumberColumn

Argument = str | float | int | bool

CLOCK = 1e6
"""Time (s) beyond which a time of a trajectory is that of a clock, such as UNIX seconds: 11.6 days
"""
MAX_INLINED = 200_000
"""Most elements that catalogue entries may add to a document."""
MAX_NESTING = 32
"""Most catalogue entries that may lie inside each other."""

_CATALOGS_CLOSED_SINCE = (1, 2)
_DECLARING = ("ParameterDeclaration", "ValueConstraint")
_Scopes = dict[etree._Element, ParameterScope]
"""Scopes by the element that opens them."""

_Report = Callable[[ToolchainError], None]
"""Handler of a violated constraint."""

_symbolic = etree.XPath("descendant-or-self::*[@*[contains(., '$')]]")


@dataclass(frozen=True, eq=False)
class Resolved(Document):
    """A scenario without parameters, expressions and catalogue references left in it.

    Elements that came from a catalogue know their file: `Node.where` names it.

    Attributes:
        parameters: the global parameters by name.
        variables: the variables by name, with their initial values.
        monitors: initial values of the monitors by name.
        logic_file: the road network (an OpenDRIVE file, as a rule); None where the scenario has
            none.
        scene_graph_file: the 3D model; None where the scenario has none.
        violations: parameter values that violate their constraint groups, where that was not to be
            an error.
        for_carla: whether it is written for CARLA's scenario_runner, whose triggers are others than
            the standard's.
        mirrored: whether its axes were CARLA's, and its lateral values have changed their signs.
    """

    parameters: dict[str, ParameterDeclaration]
    variables: dict[str, Variable]
    monitors: dict[str, bool]
    logic_file: Path | None
    scene_graph_file: Path | None
    violations: tuple[ToolchainError, ...] = ()
    for_carla: bool = False
    mirrored: bool = False

    @cached_property
    def first_clock_time(self) -> float:
        """Least time (s) beyond `CLOCK` that a trajectory of the scenario has; 0 where there is
        none."""
        parts = self.node.iter("Vertex", "ControlPoint", "Clothoid", "ClothoidSplineSegment")
        names = ("time", "startTime", "timeStart")
        times = (part.finite(name) for part in parts for name in names if part.has(name))
        return min((time for time in times if time > CLOCK), default=0.0)


def resolve(
    document: Document,
    parameters: Mapping[str, Argument] | None = None,
    *,
    enforce_constraints: bool = True,
    strict: bool = False,
    catalog_path: Folders = (),
    columns: Mapping[str, NumberColumn] | None = None,
) -> Resolved:
    """A copy of a scenario in which everything known at load time has been worked out.

    Parameters get the given values instead of their defaults, before the defaults that depend on
    them are evaluated (a given text may be an expression, as a default may). An entry of a
    catalogue of version 1.2 or later sees only the parameters that it declares itself (rule
    asam.net:xosc:1.2.0:parameters.valid_parameter_declaration_in_catalogs); an earlier one also
    sees those at the place of the reference. `name` attributes are texts, for which the standard
    knows no expressions: `${` stays as it is there, and in references to such a name. A
    parameterRef is a name, so the `$` that some early files put before it is dropped.

    Args:
        document: what `load` returned; it is not changed.
        parameters: values of global parameters by name.
        enforce_constraints: whether a value that violates its constraint groups is an error, or
            only recorded.
        strict: refuse the faults that are otherwise repaired with a remark, those of the document
            among them.
        catalog_path: folders in which directories of catalogues are looked for that are not where
            the scenario says.
        columns: values of global parameters in many sets, for a document that is read for all of
            them (`schemas.expressions.columns.reading`).

    Raises:
        NotInArrays: a document can't be read for many sets.
        UsageError: a given parameter does not exist or is not of its type; the document is no
            scenario.
        InvalidFile: an unknown parameter or malformed expression is used, a constraint is violated,
            or a catalogue reference leads nowhere, to several entries, or round in a circle.

    Example:
        >>> import xosc_toolchain as xt
        >>> scenario = xt.resolve(xt.load("xosc/library/simple_cut_in.xosc"), {"CutIn_Gap_m": 12})
        >>> scenario.parameters["CutIn_Gap_m"].value, scenario.logic_file.name
        (12.0, 'highway_straight.xodr')
    """
    if document.kind != "scenario":
        raise UsageError(f"this is a {document.kind}, a scenario is expected", path=document.path)
    with with_ignored(document.remarks):
        return _resolved(
            document, parameters or {}, enforce_constraints, strict, catalog_path, columns or {}
        )


def _resolved(
    document: Document,
    parameters: Mapping[str, Argument],
    enforce_constraints: bool,
    strict: bool,
    catalog_path: Folders,
    columns: Mapping[str, NumberColumn],
) -> Resolved:
    # The whole tree: comments before the root, such as licences, are siblings of it.
    root = copy.deepcopy(document.root.getroottree()).getroot()
    node = Node(root, document.path)
    assigned = {name: _argument(value, node) for name, value in parameters.items()}
    for name, values in columns.items():
        assigned[name] = replace(_argument(float(values[0]), node), column=values)
    violations: list[ToolchainError] = []
    report = _refuse if enforce_constraints else violations.append
    remarks = Remarks(strict)
    remarks.add(*document.remarks)
    scopes = _bind(node, None, assigned, report, remarks)
    catalogs = Catalogs(document.path, partial(_directory, node), load, remarks, catalog_path)
    # After `_bind`: the name of an entry may have been a parameter.
    _Inliner(catalogs, report, remarks).inline(node, scopes, ())
    # Literal attributes were repaired by `load`: only parameters can have brought such values.
    if any(
        declaration.get("value") in attributes.NOTHING
        for declaration in root.iter("ParameterDeclaration")
    ):
        remarks.add(*attributes.leave_out_absent_values(node, document.version))
    for_carla, mirrored = is_for_carla(node), is_mirrored(node)
    remarks.add(*to_standard(node))
    return Resolved(
        path=document.path,
        root=root,
        version=document.version,
        kind=document.kind,
        parameters=scopes[root].own,
        variables=variables(_declared(node, "VariableDeclarations"), remarks),
        monitors=monitors(_declared(node, "MonitorDeclarations")),
        logic_file=_file(node, "LogicFile"),
        scene_graph_file=_file(node, "SceneGraphFile"),
        violations=tuple(violations),
        remarks=remarks.found,
        for_carla=for_carla,
        mirrored=mirrored,
    )


def _refuse(violation: ToolchainError) -> None:
    raise violation


def _bind(
    top: Node,
    outer: ParameterScope | None,
    assigned: Mapping[str, Assignment],
    report: _Report,
    remarks: Remarks,
) -> _Scopes:
    """Make every attribute of the elements of one file a literal, in place; the result has a scope
    for `top` at least."""
    scopes = {top.element: _declare(top, outer, assigned, report, remarks)}
    for declarations in list(top.element.iter("ParameterDeclarations")):
        owner = declarations.getparent()
        # Document order, outer scopes first: inner defaults may use outer parameters.
        if owner is not None and owner not in scopes:
            scopes[owner] = _declare(
                Node(owner, top.path), _scope_around(owner, scopes), {}, report, remarks
            )
    for element in cast(list[etree._Element], _symbolic(top.element)):
        if element.tag not in _DECLARING:
            _substitute(Node(element, top.path), _scope_around(element, scopes), remarks)
    return scopes


def _declare(
    owner: Node,
    outer: ParameterScope | None,
    assigned: Mapping[str, Assignment],
    report: _Report,
    remarks: Remarks,
) -> ParameterScope:
    """The scope that an element opens; its declarations and constraints become literals."""
    declarations = _declared(owner, "ParameterDeclarations")
    scope = ParameterScope(declarations, outer, assigned, remarks)
    parameters = scope.own
    for declaration in declarations:
        parameter = parameters[declaration.get("name")]
        declaration.element.set("value", parameter.text)
        # The XSDs before 1.2 know `integer` alone: it stays.
        if declaration.get("parameterType") not in (parameter.type, "integer"):
            declaration.element.set("parameterType", parameter.type)
        for constraint in declaration.iter("ValueConstraint"):
            _substitute(constraint, scope, remarks)
    for violation in scope.violations():
        report(violation)
    return scope


def _substitute(node: Node, scope: ParameterScope, remarks: Remarks) -> None:
    for name, text in cast(list[tuple[str, str]], node.element.items()):
        if "$" not in text or (name == "name" and is_expression(text)):
            continue
        if name == "parameterRef":
            node.element.set(name, text.removeprefix("$"))
            continue
        if name == "storyboardElementRef" and is_expression(text) and _is_name(text, node):
            remarks.add(
                node.remark(
                    OPERATORS,
                    f"{name}={quoted(text)}: an element has this name as it stands, and is meant",
                )
            )
            continue
        try:
            node.element.set(name, scope.literal(text, node))
        except ExpressionError as error:
            raise node.invalid(f"{name}={quoted(text)}: {error.message}") from None


def _is_name(text: str, node: Node) -> bool:
    """Whether an element of the same file has a text as its name; names are no expressions."""
    return bool(node.element.getroottree().xpath("//*[@name=$text]", text=text))


def _scope_around(element: etree._Element, scopes: _Scopes) -> ParameterScope:
    current: etree._Element | None = element
    while current is not None and current not in scopes:
        current = current.getparent()
    assert current is not None, "the top element has a scope"
    return scopes[current]


class _Inliner:
    """Puts catalogue entries in the place of the references to them."""

    def __init__(self, catalogs: Catalogs, report: _Report, remarks: Remarks) -> None:
        self._catalogs = catalogs
        self._report = report
        self._remarks = remarks
        self._elements = 0

    def inline(self, top: Node, scopes: _Scopes, inside: tuple[CatalogEntry, ...]) -> None:
        """Replace the references below `top`, which lies inside those entries and whose attributes
        are literals."""
        # Listed first: entries bring references of their own, which `_entry` replaces.
        references = [
            (element, _scope_around(element, scopes)) for element in top.element.iter(*REFERENCES)
        ]
        for element, scope in references:
            reference, parent = Node(element, top.path), cast(etree._Element, element.getparent())
            if parent.tag == "Trailer" and not reference.get("entryName"):
                self._remarks.add(
                    reference.remark(ENTRIES, "entryName is empty; the vehicle has no trailer")
                )
                _leave_out_trailer(parent)
            else:
                parent.replace(element, self._entry(reference, scope, inside))

    def _find(self, reference: Node) -> CatalogEntry | None:
        """The entry that is referred to; None for a controller, which is not executed, that is not
        there."""
        holder = reference.parent
        assert holder is not None, "references are below the top element"
        catalog = reference.get("catalogName")
        try:
            entry = self._catalogs.find(holder.tag, catalog, reference.get("entryName"))
        except NoEntry as error:
            if EXPECTED.get(holder.tag) != ("Controller",):
                raise reference.invalid(str(error)) from None
            self._remarks.add(
                reference.remark(
                    ENTRIES,
                    f"{error}; the controller would not be executed, an empty one is assumed",
                )
            )
            return None
        if entry.catalog != catalog:
            name = Path(entry.path).name
            message = (
                f"no catalogue is called {quoted(catalog)}; {name}, called "
                f"{quoted(entry.catalog)}, is taken by its file name"
            )
            self._remarks.add(reference.remark(ENTRIES, message))
        self._remarks.add(*(_in_use(remark, entry) for remark in load(entry.path).remarks))
        return entry

    def _entry(
        self, reference: Node, scope: ParameterScope, inside: tuple[CatalogEntry, ...]
    ) -> etree._Element:
        entry = self._find(reference)
        if entry is None:
            return _empty_controller(reference)
        # Found by identity: the cache of catalogues gives the same object each time.
        if entry in inside:
            circle = [*inside[inside.index(entry) :], entry]
            raise reference.invalid(
                f"catalogue entries refer to each other in a circle: {' → '.join(map(str, circle))}"
            )
        if len(inside) >= MAX_NESTING:
            raise reference.invalid(
                f"catalogue entries lie inside each other deeper than {MAX_NESTING} levels"
            )
        # Counted before the copy: entries that hold two others each would double at every level.
        self._elements += entry.size
        if self._elements > MAX_INLINED:
            raise reference.invalid(
                f"catalogue entries would add more than {MAX_INLINED} elements to the document"
            )
        element = copy.deepcopy(entry.element)
        element.tail = reference.element.tail
        element.set(SOURCE, entry.path)
        element.set(LINE, str(entry.element.sourceline))
        assigned = _assignments(reference)
        # Any other entry is complete as it is in its file.
        if assigned or not entry.plain:
            node = Node(element, Path(entry.path))
            outer = scope if entry.version < _CATALOGS_CLOSED_SINCE else None
            self.inline(
                node, _bind(node, outer, assigned, self._report, self._remarks), (*inside, entry)
            )
        return element


def _in_use(remark: Remark, entry: CatalogEntry) -> Remark:
    """Return a remark on a catalogue; where it is on another entry, no run is
    inconclusive by it.
    """
    lines = [cast(int, element.sourceline or 0) for element in entry.element.iter()]
    return (
        remark
        if remark.line is None or lines[0] <= remark.line <= max(lines)
        else replace(remark, cause="")
    )


def _leave_out_trailer(trailer: etree._Element) -> None:
    """Remove a Trailer, and the one around it."""
    vehicle = cast(etree._Element, trailer.getparent())
    if vehicle.tag == "Trailer":
        trailer, vehicle = vehicle, cast(etree._Element, vehicle.getparent())
    vehicle.remove(trailer)


def _empty_controller(reference: Node) -> etree._Element:
    element = etree.Element(
        "Controller", {"name": reference.get("entryName"), LINE: str(reference.line)}
    )
    etree.SubElement(element, "Properties")
    element.tail = reference.element.tail
    return element


def _directory(scenario: Node, location: str) -> Directory | None:
    """Return the directory of a catalogue location of a scenario without parameters."""
    node = scenario.find("CatalogLocations", location)
    if node is None:
        return None
    directory = node.need("Directory")
    return Directory(directory.file("path"), directory.path, directory.line)


def _assignments(reference: Node) -> dict[str, Assignment]:
    parameters = reference.find("ParameterAssignments")
    assignments: dict[str, Assignment] = {}
    for node in parameters.children("ParameterAssignment") if parameters else ():
        name = node.get("parameterRef")
        if name in assignments:
            raise node.invalid(f"the parameter {quoted(name)} is assigned twice")
        assignments[name] = Assignment(node.get("value"), node.invalid, remark=node.remark)
    return assignments


def _argument(value: Argument, scenario: Node) -> Assignment:
    """A value given by the caller: where it does not fit, the call is wrong and not the file."""

    def usage_error(message: str) -> ToolchainError:
        return UsageError(message, path=scenario.path)

    return Assignment(_text(value), usage_error, symbolic=True)


def _text(value: Argument) -> str:
    """A Python or numpy value as it is written in a file."""
    # bool is an Integral; numpy's numbers are registered as Integral and Real.
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Integral):
        return str(int(value))
    if isinstance(value, Real):
        # XML Schema writes INF.
        return repr(float(value)).replace("inf", "INF")
    return str(value)


def _declared(owner: Node, wrapper: str) -> list[Node]:
    return [
        declaration
        for declarations in owner.children(wrapper)
        for declaration in declarations.children()
    ]


def _file(scenario: Node, name: str) -> Path | None:
    node = scenario.find("RoadNetwork", name)
    return node.file("filepath") if node is not None and node.get("filepath").strip() else None
