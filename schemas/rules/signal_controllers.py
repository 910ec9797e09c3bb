"""Signal controllers refer to others that exist, and not to themselves."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.graphs import on_cycles
from schemas.checks.messages import unknown
from schemas.checks.registry import Finding, rule


@rule("asam.net:xosc:1.0.0:reference_control.traffic_signal_controller_references", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """The reference of a TrafficSignalController shall name another TrafficSignalController, and not lead back to itself."""
    controllers = {document.value(each, "name"): each for each in document.elements("TrafficSignalController")}
    references = {name: document.value(each, "reference") for name, each in controllers.items()}
    for name, reference in references.items():
        if reference is not None and reference not in controllers:
            message = f"reference: {unknown('traffic signal controller', reference, filter(None, controllers))}"
            yield Finding(controllers[name], message)
    for name in on_cycles({name: [reference] if reference is not None else [] for name, reference in references.items()}):
        yield Finding(controllers[name], f"the traffic signal controller {name!r} refers to itself")
