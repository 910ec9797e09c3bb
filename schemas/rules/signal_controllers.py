"""Signal controllers refer to others that exist, and not to themselves."""

from collections.abc import Iterator

from schemas.rules.document import Document
from schemas.rules.registry import Finding, rule
from schemas.rules.wording import unknown


@rule("asam.net:xosc:1.0.0:reference_control.traffic_signal_controller_references", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """The reference of a TrafficSignalController shall name another TrafficSignalController, and not lead back to itself."""
    references = {
        document.value(element, "name"): document.value(element, "reference")
        for element in document.elements("TrafficSignalController")
    }
    for element in document.elements("TrafficSignalController"):
        name, current = document.value(element, "name"), document.value(element, "reference")
        if current is None:
            continue
        if current not in references:
            yield Finding(element, f"reference: {unknown('traffic signal controller', current, filter(None, references))}")
            continue
        passed = {name}
        while current is not None and current not in passed:
            passed.add(current)
            current = references.get(current)
        if current == name:
            yield Finding(element, f"the traffic signal controller {name!r} refers to itself")
