"""VisibilityAction, LightStateAction and AnimationAction: seen by conditions on their states,
sensors and the event log."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

from runner.engine.compile.element import PrivateAction
from runner.engine.compile.protocols import Running
from runner.engine.compile.registry import action
from runner.engine.participants.entity import Entity
from xosc.document.node import Node

if TYPE_CHECKING:
    from runner.engine.compile.protocols import Run
    from runner.engine.compile.registry import Context

_EPSILON = 1e-9


class Waiting(Running):
    """Action in execution that takes time and does nothing else."""

    __slots__ = ("_left",)

    def __init__(self, duration: float) -> None:
        self._left = duration

    def step(self, dt: float) -> bool:
        """True once the duration is over."""
        self._left -= dt
        return self._left <= _EPSILON


@action("VisibilityAction")
@dataclass(frozen=True, slots=True)
class VisibilityAction(PrivateAction):
    """Hides an entity from images, sensors (a system under test does not see it) or traffic (SUMO's
    drivers do not).

    With a SensorReferenceSet only the named sensors are meant. Sensors are not modelled one by one
    here: the system under test loses sight of the entity when all sensors do, which is when none is
    named.
    """

    visible: dict[str, bool]
    sensors: tuple[str, ...]

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> VisibilityAction:
        """Build from a VisibilityAction element."""
        sensors = node.find("SensorReferenceSet")
        names = (
            tuple(s.get("name") for s in sensors.children("SensorReference"))
            if sensors is not None
            else ()
        )
        return cls({name: node.bool(name) for name in ("graphics", "sensors", "traffic")}, names)

    def start(self, actor: Entity, run: Run) -> None:
        """Apply at once."""
        before = actor.visible["sensors"]
        actor.visible = dict(self.visible)
        if self.sensors:
            actor.visible["sensors"] = before
        run.world.show(actor, self.visible["traffic"])
        shown = ", ".join(name for name, visible in self.visible.items() if visible) or "no one"
        only = f" (sensors: {', '.join(self.sensors)})" if self.sensors else ""
        run.note("visibility", actor.name, f"visible to {shown}{only}")


@action("LightStateAction")
@dataclass(frozen=True, slots=True)
class LightStateAction(PrivateAction):
    """Switches a light; complete after its transition time."""

    light: str
    mode: str
    transition: float

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> LightStateAction:
        """Build from a LightStateAction element."""
        light, state = node.need("LightType").only(), node.need("LightState")
        name = (
            light.get("vehicleLightType")
            if light.tag == "VehicleLight"
            else light.get("userDefinedLightType")
        )
        transition = node.finite("transitionTime", 0.0)
        if transition < 0.0:
            raise node.invalid(f"transitionTime={transition} must not be negative")
        return cls(name, state.choice("mode", ("on", "off", "flashing")), transition)

    def claims(self) -> tuple[str, ...]:
        """Each light is a domain of its own."""
        return (f"lighting:{self.light}",)

    def start(self, actor: Entity, run: Run) -> Waiting | None:
        """Switch at once, complete after the transition."""
        actor.lights = MappingProxyType({**actor.lights, self.light: self.mode})
        run.note("light", actor.name, f"{self.light} {self.mode}")
        return Waiting(self.transition) if self.transition > 0.0 else None


@action("AnimationAction")
@dataclass(frozen=True, slots=True)
class AnimationAction(PrivateAction):
    """Animates a component, a pedestrian, or from a file; complete after its duration, never if it
    loops."""

    target: str
    state: float | None
    loop: bool
    duration: float

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> AnimationAction:
        """Build from an AnimationAction element."""
        duration = node.finite("animationDuration", 0.0)
        if duration < 0.0:
            raise node.invalid(f"animationDuration={duration} must not be negative")
        kind = node.need("AnimationType").only()
        inner = kind.children()
        details = [
            *kind.element.attrib.values(),
            *(v for child in inner for v in child.element.attrib.values()),
        ]
        state = node.find("AnimationState")
        return cls(
            " ".join([kind.tag, *map(str, details)]),
            state.finite("state") if state is not None else None,
            node.bool("loop", False),
            duration,
        )

    def claims(self) -> tuple[str, ...]:
        """Each animated thing is a domain of its own."""
        return (f"animation:{self.target}",)

    def start(self, actor: Entity, run: Run) -> Waiting | None:
        """Begin; nothing moves in SUMO."""
        text = "started" if self.state is None else f"to state {self.state:g}"
        actor.animations[self.target] = text
        run.note("animation", actor.name, f"{self.target} {text}")
        if self.loop:
            return Waiting(float("inf"))
        return Waiting(self.duration) if self.duration > 0.0 else None
