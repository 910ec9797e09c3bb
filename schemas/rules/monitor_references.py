"""Monitors that are referred to exist."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import unresolved
from schemas.checks.registry import Finding, rule


@rule("xosc.toolchain:xosc:1.3.0:reference_control.resolvable_monitor_reference", kinds=("scenario",), since=(1, 3))
def check(document: Document) -> Iterator[Finding]:
    """A monitorRef must name a MonitorDeclaration of the scenario."""
    return unresolved(document, "monitor", document.names("MonitorDeclaration"), "monitorRef")
