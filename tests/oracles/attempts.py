"""Builders of attempts to get exit code 0 where nothing was tested.

The scene is that of tests/runner/files.py: Ego drives into Lead after 4.5 s.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from tests.runner.files import (
    at_time,
    car,
    distribution,
    place,
    scenario,
    speed_action,
    story,
)

PASSED, FAILED, USAGE, INVALID, UNSUPPORTED, ERROR, INCONCLUSIVE = range(7)
REFUSED = (USAGE, INVALID, UNSUPPORTED)
UNTESTED = (*REFUSED, INCONCLUSIVE)
NOT_PASSED = (FAILED, *UNTESTED)

BOX = '<Dimensions width="2" length="5" height="1.5"/>'
CENTRE = '<Center x="1.5" y="0" z="0.75"/>'
EGO, LEAD = place("Ego", 100, 20), place("Lead", 150, 10)
FAR = place("Ego", 100, 20) + place("Lead", 400, 20)
BRAKE = speed_action(0)


class Attempt(NamedTuple):
    """Builder of its files in a folder, options of xosc-run, and the exit codes that are right."""

    name: str
    build: Callable[[Path], object]
    options: Sequence[object] = ()
    codes: Sequence[int] = UNTESTED
    sut: str = "none"


def scene(*changes: tuple[str, str], **parts: object) -> Callable[[Path], Path]:
    """Builder of the scene with texts of its file replaced."""

    def build(folder: Path) -> Path:
        path = scenario(folder, **{"stop": 10.0, **parts})  # type: ignore[arg-type]
        text = path.read_text(encoding="utf-8")
        for old, new in changes:
            assert old in text, old
            text = text.replace(old, new)
        path.write_text(text, encoding="utf-8")
        return path

    return build


def group(condition: str, edge: str = "none", delay: object = 0) -> str:
    return (
        f'<ConditionGroup><Condition name="c" delay="{delay}" conditionEdge="{edge}">'
        f"{condition}</Condition></ConditionGroup>"
    )


def value(condition: str, **given: object) -> str:
    return group(f"<ByValueCondition>{condition}</ByValueCondition>", **given)  # type: ignore[arg-type]


def of(entity: str, condition: str, **given: object) -> str:
    return group(
        '<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any">'
        f'<EntityRef entityRef="{entity}"/></TriggeringEntities>'
        f"<EntityCondition>{condition}</EntityCondition></ByEntityCondition>",
        **given,  # type: ignore[arg-type]
    )


def time(at: object, rule: str = "greaterOrEqual", **given: object) -> str:
    return value(f'<SimulationTimeCondition value="{at}" rule="{rule}"/>', **given)


def waits(
    trigger: str, action: str = BRAKE, actor: str = "Lead", **parts: object
) -> Callable[[Path], Path]:
    """Scene whose only event waits for a trigger; it would brake Lead. Ego keeps its distance."""
    stories = story(actor, [(0.5, action)]).replace(at_time(0.5), trigger)
    return scene(**{"init": FAR, "stop": 3.0, "stories": stories, **parts})


def private(action: str) -> str:
    return f"<PrivateAction>{action}</PrivateAction>"


def gone(entity: str) -> str:
    return (
        f'<GlobalAction><EntityAction entityRef="{entity}"><DeleteEntityAction/></EntityAction>'
        "</GlobalAction>"
    )


def at(entity: str, x: object, y: object, z: object = 0, speed: object = 20) -> str:
    position = f'<WorldPosition x="{x}" y="{y}" z="{z}" h="0"/>'
    teleport = private(f"<TeleportAction><Position>{position}</Position></TeleportAction>")
    return f'<Private entityRef="{entity}">{teleport}{speed_action(speed)}</Private>'


def activate(lateral: object, longitudinal: object) -> str:
    return private(
        f'<ControllerAction><ActivateControllerAction lateral="{lateral}" '
        f'longitudinal="{longitudinal}"/></ControllerAction>'
    )


def criterion(name: str, reference: str = "", number: str = "", delay: object = 0) -> str:
    return (
        f'<ConditionGroup><Condition name="criteria_{name}" delay="{delay}" conditionEdge="rising">'
        f'<ByValueCondition><ParameterCondition parameterRef="{reference}" value="{number}" '
        'rule="lessThan"/></ByValueCondition></Condition></ConditionGroup>'
    )


def judged(*arguments: object) -> Callable[[Path], Path]:
    end = at_time(3.0, "end")
    return scene((end, end + criterion(*arguments)), init=FAR, stop=3.0)  # type: ignore[arg-type]


def raw(text: str | bytes, name: str = "scenario.xosc") -> Callable[[Path], Path]:
    def build(folder: Path) -> Path:
        path = folder / name
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return path

    return build


def part(first: int, last: int) -> Callable[[Path], Path]:
    """The scene's file from a share to a share (%) of its length."""

    def build(folder: Path) -> Path:
        path = scene()(folder)
        data = path.read_bytes()
        path.write_bytes(data[len(data) * first // 100 : len(data) * last // 100])
        return path

    return build


def box(dimensions: str, centre: str = CENTRE) -> Callable[[Path], Path]:
    return scene((BOX, f"<Dimensions {dimensions}/>"), (CENTRE, centre))


def system(source: str) -> Callable[[Path], Path]:
    """The scene, and a module with a class System beside it."""

    def build(folder: Path) -> Path:
        (folder / "attempted_system.py").write_text(source, encoding="utf-8")
        return scene()(folder)

    return build


def folder_with(*others: Callable[[Path], object]) -> Callable[[Path], Path]:
    """A folder with a scenario that passes and with more."""

    def build(folder: Path) -> Path:
        inner = folder / "batch"
        scenario(
            inner, "sound", init=FAR, stop=1.0, stories=story("Lead", [(0.2, speed_action(19))])
        )
        for make in others:
            make(inner)
        return inner

    return build


def varied(*ranges: object, of_file: str = "scenario", name: str = "Gap") -> Callable[[Path], Path]:
    def build(folder: Path) -> Path:
        scene()(folder)
        return distribution(folder, "variation", {name: tuple(ranges)}, of_file)  # type: ignore[dict-item]

    return build


def catalogue(entry: str, kept: bool = True) -> Callable[[Path], Path]:
    """The scene whose Ego is an entry of a catalogue."""

    def build(folder: Path) -> Path:
        header = (
            '<FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" author="t" '
            'description="t"/>'
        )
        vehicle = car("Ego").split("ScenarioObject")[1].split(">", 1)[1].rsplit("<", 1)[0]
        if kept:
            (folder / "cars").mkdir()
            (folder / "cars" / "cars.xosc").write_text(
                f'<OpenSCENARIO>{header}<Catalog name="cars">{vehicle}</Catalog></OpenSCENARIO>'
            )
        reference = f'<CatalogReference catalogName="cars" entryName="{entry}"/>'
        ego = f'<ScenarioObject name="Ego">{reference}</ScenarioObject>'
        location = (
            "<CatalogLocations><VehicleCatalog><Directory "
            'path="cars"/></VehicleCatalog></CatalogLocations>'
        )
        return scene(("<CatalogLocations/>", location), entities=[ego, car("Lead")])(folder)

    return build


PEDESTRIAN = (
    '<ScenarioObject name="Ego"><Pedestrian name="p" mass="80" pedestrianCategory="pedestrian">'
    '<BoundingBox><Center x="0" y="0" z="0.9"/><Dimensions width="0.5" length="0.6" height="1.8"/>'
    "</BoundingBox></Pedestrian></ScenarioObject>"
)
HEAD = (
    "class System:\n    def reset(self, ego, timestep, seed): pass\n    def control(self, "
    "observation, dt):\n"
)
OWN = "attempted_system:System"
SPEED = '<SpeedCondition value="{}" rule="greaterThan"/>'
BARE = ("<Actions>", "<Actions><!--"), ("</Actions>", "--></Actions>")
STATE = (
    '<StoryboardElementStateCondition storyboardElementType="{}" storyboardElementRef="{}" '
    'state="{}"/>'
)
END = at_time(10.0, "end")
RENAMED = ('"Ego"', '"Host"')
