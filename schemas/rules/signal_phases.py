"""Phases that are referred to exist."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import unknown
from schemas.checks.registry import Finding, rule


@rule("xosc.toolchain:xosc:1.0.0:reference_control.resolvable_phase_reference", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """The phase of an action or a condition on a traffic signal controller must be one of that controller's phases."""
    phases = {
        document.value(controller, "name"): {document.value(phase, "name") or "" for phase in controller.iter("Phase")}
        for controller in document.elements("TrafficSignalController")
    }
    for element, _, controller in document.values("trafficSignalControllerRef"):
        phase = document.value(element, "phase")
        if controller in phases and phase is not None and phase not in phases[controller]:
            yield Finding(element, f"phase: {unknown('phase', phase, phases[controller])} of the controller {controller!r}")
