"""Traffic signals, their controllers and phases that are referred to exist."""

from __future__ import annotations

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.findings import negative, on_cycles, unknown, unresolved
from schemas.checks.registry import Finding, rule

SIGNAL_UID = "asam.net:xosc:1.0.0:reference_control.traffic_signal_state_references"


@rule(SIGNAL_UID, kinds=("scenario",))
def signal_exists(document: Document) -> Iterator[Finding]:
    """The signals of a TrafficSignalState and of a TrafficSignalCondition must exist in the road network."""
    yield from _unknown_signals(document, "TrafficSignalState", "trafficSignalId")
    yield from _unknown_signals(document, "TrafficSignalCondition", "name")


@rule("asam.net:xosc:1.2.0:reference_control.resolvable_signal_id_in_traffic_signal_state_action", kinds=("scenario",))
def signal_of_action_exists(document: Document) -> Iterator[Finding]:
    """The name of a TrafficSignalStateAction must be the id of a signal in the road network."""
    yield from _unknown_signals(document, "TrafficSignalStateAction", "name")


def _unknown_signals(document: Document, tag: str, attribute: str) -> Iterator[Finding]:
    network = document.road_network
    for element in document.elements(tag) if network else ():
        name = document.value(element, attribute)
        if network and name is not None and name not in network.signals:
            yield Finding(element, f"{attribute}: {unknown('signal', name, network.signals)} in {network.path.name}")


@rule(
    "asam.net:xosc:1.2.0:reference_control.resolvable_traffic_signal_controller_by_traffic_signal_controller_ref",
    kinds=("scenario",),
)
def signal_controller_exists(document: Document) -> Iterator[Finding]:
    """A trafficSignalControllerRef must name a TrafficSignalController of the scenario's RoadNetwork."""
    controllers = document.names("TrafficSignalController")
    return unresolved(document, "traffic signal controller", controllers, "trafficSignalControllerRef")


@rule("asam.net:xosc:1.0.0:reference_control.traffic_signal_controller_references", kinds=("scenario",))
def signal_controllers_refer_to_others(document: Document) -> Iterator[Finding]:
    """The reference of a TrafficSignalController shall name another TrafficSignalController, and not lead back to itself."""
    controllers = {document.value(each, "name"): each for each in document.elements("TrafficSignalController")}
    references = {name: document.value(each, "reference") for name, each in controllers.items()}
    for name, reference in references.items():
        if reference is not None and reference not in controllers:
            message = f"reference: {unknown('traffic signal controller', reference, filter(None, controllers))}"
            yield Finding(controllers[name], message)
    for name in on_cycles({name: [reference] if reference is not None else [] for name, reference in references.items()}):
        yield Finding(controllers[name], f"the traffic signal controller {name!r} refers to itself")


@rule("xosc.toolchain:xosc:1.0.0:reference_control.resolvable_phase_reference", kinds=("scenario",))
def phase_exists(document: Document) -> Iterator[Finding]:
    """The phase of an action or a condition on a traffic signal controller must be one of that controller's phases."""
    phases = {
        document.value(controller, "name"): {document.value(phase, "name") or "" for phase in controller.iter("Phase")}
        for controller in document.elements("TrafficSignalController")
    }
    for element, _, controller in document.values("trafficSignalControllerRef"):
        phase = document.value(element, "phase")
        if controller in phases and phase is not None and phase not in phases[controller]:
            yield Finding(element, f"phase: {unknown('phase', phase, phases[controller])} of the controller {controller!r}")


@rule("asam.net:xosc:1.2.0:data_type.positive_duration_in_phase")
def phase_duration_is_not_negative(document: Document) -> Iterator[Finding]:
    """The duration of a Phase of a TrafficSignalController shall be non-negative."""
    return negative(document, [("Phase", "duration")])
