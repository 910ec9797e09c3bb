"""Monitors that are referred to exist."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import unknown
from schemas.checks.registry import Finding, rule


@rule("xosc.toolchain:xosc:1.3.0:reference_control.resolvable_monitor_reference", kinds=("scenario",), since=(1, 3))
def check(document: Document) -> Iterator[Finding]:
    """A monitorRef must name a MonitorDeclaration of the scenario."""
    monitors = document.names("MonitorDeclaration")
    for element, attribute, name in document.values("monitorRef"):
        if name not in monitors:
            yield Finding(element, f"{attribute}: {unknown('monitor', name, monitors)}")
