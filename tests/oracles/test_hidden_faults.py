"""More attempts to get exit code 0 where nothing was tested: systems, encodings,
conditions, limits, batches.

Each has its exit code, and a sentence that names the reason where it is no plain verdict.
"""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable, Sequence
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from runner.batch.outputs.folder import digests
from schemas.common.storage import Records
from tests.commands import Answer, Command
from tests.oracles.attempts import (
    BOX,
    BRAKE,
    CENTRE,
    EGO,
    END,
    ERROR,
    FAILED,
    FAR,
    HEAD,
    INCONCLUSIVE,
    INVALID,
    LEAD,
    NOT_PASSED,
    OWN,
    PASSED,
    REFUSED,
    SPEED,
    STATE,
    UNTESTED,
    USAGE,
    Attempt,
    activate,
    at,
    catalogue,
    criterion,
    folder_with,
    group,
    of,
    private,
    raw,
    scene,
    system,
    value,
    varied,
    waits,
)
from tests.runner.files import (
    HEADER,
    at_time,
    car,
    distribution,
    place,
    scenario,
    speed_action,
    story,
)


def encoded(change: Callable[[str], bytes], name: str = "scenario.xosc") -> Callable[[Path], Path]:
    """The scene's text written as other bytes."""

    def build(folder: Path) -> Path:
        text = scene()(folder).read_text(encoding="utf-8")
        (folder / "scenario.xosc").unlink()
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(change(text))
        return path

    return build


def declared(text: str, encoding: str) -> str:
    return text.replace('encoding="UTF-8"', f'encoding="{encoding}"')


def answering(expression: str, imports: str = "") -> Callable[[Path], Path]:
    """The scene, and a system that answers an expression."""
    head = f"import math\nfrom runner.systems import Control, Pose\n{imports}\n{HEAD}"
    return system(f"{head}        return {expression}\n")


def everyone(rule: str, entities: str, condition: str) -> str:
    return group(
        f'<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="{rule}">{entities}'
        f"</TriggeringEntities><EntityCondition>{condition}</EntityCondition></ByEntityCondition>"
    )


def refs(*names: str) -> str:
    return "".join(f'<EntityRef entityRef="{name}"/>' for name in names)


def varied_set(*values: object, name: str = "Gap") -> Callable[[Path], Path]:
    """A variation file with these values in a set."""

    def build(folder: Path) -> Path:
        path = varied(40.0, 60.0, 10.0)(folder)
        elements = "".join(f'<Element value="{value}"/>' for value in values)
        text = path.read_text(encoding="utf-8")
        begin, end = text.index("<DistributionRange"), text.index("</DistributionRange>")
        text = (
            text[:begin]
            + f"<DistributionSet>{elements}</DistributionSet>"
            + text[end + len("</DistributionRange>") :]
        )
        path.write_text(text.replace('"Gap"', f'"{name}"'), encoding="utf-8")
        return path

    return build


def constrained(folder: Path) -> Path:
    """A variation of which each set violates a constraint."""
    path = varied(40.0, 60.0, 10.0)(folder)
    inner = folder / "scenario.xosc"
    old = '<ParameterDeclaration name="Gap" parameterType="double" value="50.0"/>'
    text = inner.read_text(encoding="utf-8")
    assert old in text
    group = '<ConstraintGroup><ValueConstraint rule="greaterThan" value="100"/></ConstraintGroup>'
    new = old.replace('value="50.0"/>', f'value="150">{group}</ParameterDeclaration>')
    inner.write_text(text.replace(old, new), encoding="utf-8")
    return path


def stochastic(runs: object, inner: str) -> Callable[[Path], Path]:
    def build(folder: Path) -> Path:
        scene()(folder)
        path = folder / "variation.xosc"
        path.write_text(
            f"<OpenSCENARIO>{HEADER}<ParameterValueDistribution>"
            f'<ScenarioFile filepath="scenario.xosc"/><Stochastic numberOfTestRuns="{runs}" '
            'randomSeed="1">'
            "<StochasticDistribution "
            f'parameterName="Gap">{inner}</StochasticDistribution></Stochastic>'
            "</ParameterValueDistribution></OpenSCENARIO>",
            encoding="utf-8",
        )
        return path

    return build


def beside(*others: Callable[[Path], object]) -> Callable[[Path], Path]:
    """A glob of a folder with a scenario that passes and with more."""
    return lambda folder: folder_with(*others)(folder) / "*"


def linked(target: str, name: str) -> Callable[[Path], object]:
    def build(folder: Path) -> None:
        (folder / name).symlink_to(target)

    return build


def elsewhere(folder: Path) -> None:
    """A link of the folder to the scene, which lies beside it."""
    path = scene()(folder.parent / "other")
    (folder / "z.xosc").symlink_to(path)


def upper(folder: Path) -> None:
    scene()(folder).rename(folder / "Z.XOSC")


def in_folder_named_as_file(folder: Path) -> None:
    scene()(folder / "inner.xosc")


def road_with(*changes: tuple[str, str]) -> Callable[[Path], Path]:
    def build(folder: Path) -> Path:
        path = scene()(folder)
        road = folder / "straight.xodr"
        text = road.read_text(encoding="utf-8")
        for old, new in changes:
            assert old in text, old
            text = text.replace(old, new)
        road.write_text(text, encoding="utf-8")
        return path

    return build


def visible(flag: object) -> str:
    return private(f'<VisibilityAction graphics="{flag}" sensors="{flag}" traffic="{flag}"/>')


def teleport(s: object) -> str:
    where = f'<LanePosition roadId="1" laneId="-1" s="{s}"/>'
    return private(f"<TeleportAction><Position>{where}</Position></TeleportAction>")


def added(entity: str, s: object) -> str:
    where = f'<LanePosition roadId="1" laneId="-1" s="{s}"/>'
    return (
        f'<GlobalAction><EntityAction entityRef="{entity}"><AddEntityAction><Position>{where}'
        "</Position></AddEntityAction></EntityAction></GlobalAction>"
    )


NOBODY = '<EntityRef entityRef="Ego"/>'
NO_ROAD = ('<LogicFile filepath="straight.xodr"/>', "")
SOUND = {"init": FAR, "stop": 3.0, "stories": story("Lead", [(0.5, speed_action(19))])}
CRUISING = scene(**SOUND)

ATTEMPTS = [
    # bytes of files
    Attempt("UTF-16", encoded(lambda t: declared(t, "UTF-16").encode("utf-16")), codes=(FAILED,)),
    Attempt("UTF-8 with a BOM", encoded(lambda t: t.encode("utf-8-sig")), codes=(FAILED,)),
    Attempt("CRLF", encoded(lambda t: t.replace("\n", "\r\n").encode()), codes=(FAILED,)),
    Attempt("CR alone", encoded(lambda t: t.replace("\n", "\r").encode()), codes=(FAILED,)),
    Attempt(
        "Latin-1",
        encoded(
            lambda t: declared(t, "ISO-8859-1").replace('"Lead"', '"Le\u00e4d"').encode("latin-1")
        ),
        codes=(FAILED,),
    ),
    Attempt(
        "bytes that its encoding has not",
        encoded(lambda t: t.replace('"Lead"', '"Le\u00e4d"').encode("latin-1")),
        codes=(INVALID, FAILED),  # read as Latin-1, with a remark
    ),
    Attempt(
        "an unknown encoding", encoded(lambda t: declared(t, "UTF-99").encode()), codes=(INVALID,)
    ),
    Attempt("zeros after the end", encoded(lambda t: t.encode() + bytes(100)), codes=(INVALID,)),
    Attempt("packed by gzip", encoded(lambda t: gzip.compress(t.encode())), codes=(INVALID,)),
    Attempt(
        "an entity of a DTD",
        encoded(
            lambda t: t.replace(
                "<OpenSCENARIO>", '<!DOCTYPE x [<!ENTITY e "Ego">]><OpenSCENARIO>'
            ).encode()
        ),
        codes=REFUSED,
    ),
    Attempt(
        "elements with a prefix",
        encoded(
            lambda t: (
                t.replace("</", "</o:")
                .replace("<", "<o:")
                .replace("<o:/o:", "</o:")
                .replace("<o:?xml", "<?xml")
                .replace("<o:OpenSCENARIO>", '<o:OpenSCENARIO xmlns:o="urn:o">')
                .encode()
            )
        ),
        codes=NOT_PASSED,
    ),
    Attempt(
        "entities by XInclude",
        scene(
            (
                "<Entities>",
                '<Entities xmlns:xi="http://www.w3.org/2001/XInclude"><xi:include href="a.xml"/>',
            )
        ),
        codes=NOT_PASSED,
    ),
    Attempt("blanks in the file's name", encoded(str.encode, "a b\u00e4.xosc"), codes=(FAILED,)),
    Attempt("in a folder named as a file", encoded(str.encode, "a.xosc/b.xosc"), codes=NOT_PASSED),
    # folders and several files
    Attempt("a folder with a link to a collision", folder_with(elsewhere), codes=(FAILED,)),
    Attempt(
        "a folder with a link to itself",
        folder_with(linked(".", "loop")),
        codes=(PASSED,),
    ),
    Attempt("a folder with a collision in capitals", folder_with(upper), codes=NOT_PASSED),
    Attempt(
        "a collision in a folder named as a file",
        folder_with(in_folder_named_as_file),
        codes=(FAILED,),
    ),
    Attempt("a glob with a collision", beside(scene()), codes=(FAILED,)),
    Attempt("a glob with a broken file", beside(raw("<OpenSCENARIO>", "z.xosc")), codes=(INVALID,)),
    Attempt("a glob with a note", beside(raw("todo", "z.txt")), codes=(PASSED,)),
    Attempt(
        "a sound file and an empty folder",
        lambda folder: ((folder / "empty").mkdir(), CRUISING(folder))[1],
        ("empty",),
    ),
    Attempt("a sound file and nothing", CRUISING, ("",)),
    Attempt("a sound file and a glob of nothing", CRUISING, ("*.osc",)),
    Attempt("a sound file and its road", CRUISING, ("straight.xodr",), REFUSED),
    Attempt(
        "a sound file and a folder of catalogues",
        lambda folder: (catalogue("car")(folder), CRUISING(folder))[1],
        ("cars",),
    ),
    Attempt(
        "a sound file and one that tests nothing",
        lambda folder: (
            scenario(folder, "idle", init=LEAD, stop=1.0),
            CRUISING(folder),
        )[1],
        ("idle.xosc",),
    ),
    # variations
    Attempt("three sets of one value", varied_set(50, 50, 50), codes=(FAILED,)),
    Attempt(
        "three sets that test nothing but one set",
        varied_set("200", "200.0", "2e2"),
        ("--max-time", 3),
        (PASSED,),
    ),
    Attempt("a set without values", varied_set()),
    Attempt("a set of no value", varied_set(""), codes=NOT_PASSED),
    Attempt("a set of NaN", varied_set("NaN"), codes=NOT_PASSED),
    Attempt("a variation whose sets violate a constraint", constrained),
    Attempt(
        "a parameter of the command line that the file varies",
        varied_set(40, 50),
        ("-p", "Gap=300", "--max-time", 3),
        NOT_PASSED,
    ),
    Attempt(
        "0 drawn sets",
        stochastic(
            0, '<UniformDistribution><Range lowerLimit="4" upperLimit="9"/></UniformDistribution>'
        ),
    ),
    Attempt(
        "-1 drawn sets",
        stochastic(
            -1, '<UniformDistribution><Range lowerLimit="4" upperLimit="9"/></UniformDistribution>'
        ),
    ),
    Attempt(
        "draws of an empty range",
        stochastic(
            2, '<UniformDistribution><Range lowerLimit="9" upperLimit="4"/></UniformDistribution>'
        ),
    ),
    Attempt("draws of nothing", stochastic(2, "")),
    Attempt(
        "draws with a deviation below 0",
        stochastic(2, '<NormalDistribution expectedValue="50" variance="-4"/>'),
    ),
    Attempt(
        "a variation of itself",
        lambda folder: (
            scene()(folder),
            distribution(folder, "variation", {"Gap": (4, 9, 1)}, "variation"),
        )[1],
        codes=REFUSED,
    ),
    Attempt("more sets than --max-runs", varied(40.0, 60.0, 10.0), ("--max-runs", 1), REFUSED),
    Attempt("--only between the sets", varied(40.0, 60.0, 10.0), ("--only", "1.5"), (USAGE,)),
    Attempt("--only backwards", varied(40.0, 60.0, 10.0), ("--only", "2-0"), (USAGE,)),
    Attempt("--only of a scenario", CRUISING, ("--only", "1"), (USAGE,)),
    Attempt(
        "a parameter given twice",
        scene(),
        ("-p", "Gap=50", "-p", "Gap=300", "--max-time", 3),
        (USAGE,),
    ),
    Attempt("a parameter with a blank", scene(), ("-p", "Gap =300"), (USAGE,)),
    Attempt("a parameter by a hexadecimal number", scene(), ("-p", "Gap=0x32"), NOT_PASSED),
    Attempt(
        "a parameter declared twice",
        scene(
            (
                "<ParameterDeclarations>",
                (
                    '<ParameterDeclarations><ParameterDeclaration name="Gap" '
                    'parameterType="double" value="300"/>'
                ),
            )
        ),
        codes=NOT_PASSED,
    ),
    # conditions on nobody
    Attempt("all of nobody", waits(everyone("all", "", SPEED.format(1)))),
    Attempt("none of nobody", waits(everyone("none", "", SPEED.format(1)))),
    Attempt("any of an unknown entity", waits(everyone("any", refs("Nobody"), SPEED.format(1)))),
    Attempt(
        "all with an unknown entity", waits(everyone("all", refs("Ego", "Nobody"), SPEED.format(1)))
    ),
    Attempt(
        "all with an entity that is gone",
        waits(
            everyone("all", refs("Ego", "Third"), SPEED.format(1)),
            entities=[car("Ego"), car("Lead"), car("Third")],
        ),
    ),
    Attempt(
        "a stop that waits for an entity that is never there",
        scene(
            (END, everyone("any", refs("Third"), SPEED.format(1))),
            init=FAR,
            entities=[car("Ego"), car("Lead"), car("Third")],
        ),
        ("--max-time", 3),
    ),
    Attempt(
        "a fall of a condition that never held",
        waits(of("Lead", SPEED.format(100), edge="falling")),
    ),
    Attempt(
        "a rise of a condition that always holds", waits(of("Lead", SPEED.format(1), edge="rising"))
    ),
    Attempt("a delay beyond the end", waits(of("Lead", SPEED.format(1), delay=100))),
    Attempt("a group without conditions", waits("<ConditionGroup/>")),
    Attempt(
        "a group that is executed 0 times",
        scene(
            ('maximumExecutionCount="1"', 'maximumExecutionCount="0"'),
            init=FAR,
            stop=3.0,
            stories=story("Lead", [(1, BRAKE)]),
        ),
        codes=(PASSED,),  # a remark: once is meant
    ),
    Attempt(
        "a stop trigger that a state of the storyboard never fires",
        scene(
            (END, value(STATE.format("act", "act", "stopTransition"))),
            init=FAR,
            stories=story("Lead", [(0.5, speed_action(19))]),
        ),
        ("--max-time", 3),
        (PASSED,),  # all events have happened, and the limit is the caller's
    ),
    # contacts that are hidden
    Attempt(
        "a partner that nobody sees",
        scene(init=EGO + place("Lead", 150, 10, more=visible("false"))),
        codes=(FAILED,),
    ),
    Attempt(
        "a partner that cas does not see",
        scene(init=EGO + place("Lead", 150, 0, more=visible("false"))),
        codes=NOT_PASSED,
        sut="cas",
    ),
    Attempt(
        "an ego that jumps over its partner", scene(stories=story("Ego", [(4, teleport(300))]))
    ),
    Attempt(
        "a partner that jumps behind the ego", scene(stories=story("Lead", [(4, teleport(50))]))
    ),
    Attempt(
        "a partner that rises",
        scene(
            stories=story(
                "Lead",
                [(4, at("Lead", 190, -1.75, 500).split(">", 1)[1].split(speed_action(20))[0])],
            )
        ),
        codes=NOT_PASSED,
    ),
    Attempt(
        "an ego that appears at the end",
        scene(init=LEAD, stop=5.0, stories=story("Lead", [(4.95, added("Ego", 20))])),
    ),
    Attempt(
        "an ego that is there for a moment",
        scene(init=LEAD, stop=5.0, stories=story("Lead", [(4.8, added("Ego", 20))])),
        codes=(INCONCLUSIVE,),
    ),
    Attempt(
        "a system that is switched on for a moment",
        scene(
            init=place("Ego", 100, 20, more=activate("false", "false")) + place("Lead", 160, 19),
            stop=5.0,
            stories=story("Ego", [(4.7, activate("true", "true"))]),
        ),
        codes=(INCONCLUSIVE,),
        sut="cas",
    ),
    Attempt("a stop a moment before the contact", scene(stop=4.4)),
    Attempt("a limit a moment before the contact", scene(), ("--max-time", 4.4)),
    # systems
    *(
        Attempt(f"a system that answers {text}", answering(text), sut=OWN, codes=codes)
        for text, codes in (
            ("Control(acceleration=math.nan)", (ERROR,)),
            ("Control(acceleration=math.inf)", (ERROR,)),
            ("Control(acceleration='5')", (ERROR,)),
            ("Control(acceleration=[5])", (ERROR,)),
            ("Control(acceleration=True)", (ERROR, FAILED)),
            ("Control(steering=math.nan)", (ERROR,)),
            ("Control(acceleration=0.0)", (FAILED,)),
            ("Control()", (FAILED,)),
            ("Control", (ERROR,)),
            ("(0.0, 0.0)", (ERROR,)),
            ("Pose(math.nan, 0.0, 0.0)", (ERROR,)),
            ("Pose(observation.ego.x, observation.ego.y, observation.ego.h)", NOT_PASSED),
            (
                "Pose(observation.ego.x, observation.ego.y, observation.ego.h, speed=20.0)",
                NOT_PASSED,
            ),
            ("Pose(observation.ego.x + 1000, observation.ego.y, 0.0)", NOT_PASSED),
            ("Pose(observation.ego.x + 2, observation.ego.y + 3, 0.0)", NOT_PASSED),
            ("Pose(observation.ego.x + 2, observation.ego.y + 0.6, 0.0)", (INCONCLUSIVE,)),
            ("exit()", (ERROR,)),
            ("observation.others.clear()", (ERROR,)),
        )
    ),
    Attempt(
        "a system without a step",
        system(
            "class System:\n    def reset(self, ego, timestep, seed): pass\n    control = None\n"
        ),
        sut=OWN,
        codes=(USAGE, ERROR),
    ),
    Attempt(
        "a system that fails in reset",
        system(
            "class System:\n    def reset(self, ego, timestep, seed): raise KeyboardInterrupt\n"
            "    def control(self, observation, dt): return None\n"
        ),
        sut=OWN,
        codes=(ERROR,),
    ),
    Attempt(
        "a system that takes forever",
        system(f"import time\n{HEAD}        time.sleep(60)\n"),
        ("--sut-timeout", 1),
        sut=OWN,
        codes=(ERROR,),
    ),
    Attempt(
        "a timeout of 0", answering("Control()"), ("--sut-timeout", 0), sut=OWN, codes=(USAGE,)
    ),
    Attempt(
        "a timeout of NaN",
        answering("Control()"),
        ("--sut-timeout", "nan"),
        sut=OWN,
        codes=(USAGE,),
    ),
    Attempt(
        "a system that prints a verdict",
        system(
            "from runner.systems import Control\n"
            + HEAD
            + "        print('PASSED'); return Control()\n"
        ),
        sut=OWN,
        codes=(FAILED,),
    ),
    Attempt("an FMU that is not there", scene(), sut="fmu:none.fmu", codes=REFUSED),
    Attempt(
        "an FMU that is no archive",
        lambda folder: ((folder / "a.fmu").write_text("no"), scene()(folder))[1],
        sut="fmu:a.fmu",
        codes=(*REFUSED, ERROR),
    ),
    Attempt(
        "a bridge that nobody calls", scene(), sut="bridge:port=47123,wait=0.5", codes=(ERROR,)
    ),
    Attempt(
        "a system that is switched on at the end",
        scene(
            init=place("Ego", 100, 20, more=activate("false", "false")) + place("Lead", 160, 19),
            stop=5.0,
            stories=story("Ego", [(4.95, activate("true", "true"))]),
        ),
        sut="cas",
    ),
    Attempt(
        "an ego that stands before others, cas",
        scene(init=place("Ego", 100, 0) + place("Lead", 400, 10)),
        codes=(PASSED,),  # its speed of 0 is set: it stands on purpose, with a remark
        sut="cas",
    ),
    # the ego
    Attempt(
        "two egos by name", scene(entities=[car("Ego"), car("hero"), car("Lead")]), codes=NOT_PASSED
    ),
    Attempt(
        "an ego of no kind", scene((car("Ego"), '<ScenarioObject name="Ego"/>')), codes=NOT_PASSED
    ),
    Attempt(
        "an ego that is a cone",
        scene(
            (
                car("Ego"),
                '<ScenarioObject name="Ego"><MiscObject name="c" mass="1" '
                f'miscObjectCategory="obstacle"><BoundingBox>{CENTRE}{BOX}</BoundingBox>'
                "</MiscObject></ScenarioObject>",
            )
        ),
        codes=NOT_PASSED,
        sut="cas",
    ),
    # limits
    *(
        Attempt(f"limit {text!r}", CRUISING, ("--fail-if", text), codes)
        for text, codes in (
            ("rss_risk_ad_rss>1", (USAGE,)),
            ("rss_risk_r157>=1.5", (USAGE,)),
            ("max_collision_probability>1", (USAGE,)),
            ("fatality_risk>1", (USAGE,)),
            ("min_distance<-5", (USAGE,)),
            ("max_drac<0", (USAGE, FAILED, INCONCLUSIVE)),
            ("end_time<0", (USAGE,)),
            ("end_time>1000", (USAGE, *UNTESTED)),
            ("min_ttc>=1e309", (USAGE,)),
            ("min_ttc<1;min_thw<1", (USAGE,)),
            ("min_ttc<1 ", (PASSED,)),
            ("min_ttc<<1", (USAGE,)),
            ("Lead.min_ttc<1", (USAGE,)),
            ("min_ttc<0", (USAGE,)),
        )
    ),
    Attempt(
        "off-road without a road",
        scene(
            NO_ROAD,
            ('<LanePosition roadId="1" laneId="-1" s="100"/>', '<WorldPosition x="100" y="0"/>'),
            ('<LanePosition roadId="1" laneId="-1" s="400"/>', '<WorldPosition x="400" y="0"/>'),
            **SOUND,
        ),
        ("--fail-if", "off-road"),
    ),
    Attempt(
        "road-end without a road",
        scene(
            NO_ROAD,
            ('<LanePosition roadId="1" laneId="-1" s="100"/>', '<WorldPosition x="100" y="0"/>'),
            ('<LanePosition roadId="1" laneId="-1" s="400"/>', '<WorldPosition x="400" y="0"/>'),
            **SOUND,
        ),
        ("--fail-if", "road-end"),
    ),
    Attempt(
        "rss without others", scene(entities=[car("Ego")], init=EGO, stop=2.0), ("--fail-if", "rss")
    ),
    *(
        Attempt(f"least {text!r}", CRUISING, ("--least", text), (USAGE,))
        for text in (
            "ego_seconds",
            "ego_seconds=",
            "ego_seconds=-1",
            "ego_seconds=nan",
            "egos=1",
            "ego_seconds=inf",
            "",
        )
    ),
    Attempt(
        "more evidence than there is", CRUISING, ("--least", "ego_seconds=100"), (INCONCLUSIVE,)
    ),
    # roads
    Attempt("a road of an unreadable length", road_with(('length="', 'length="x')), codes=REFUSED),
    Attempt("a road of NaN", road_with(('length="', 'length="nan" l="')), codes=REFUSED),
    Attempt(
        "a road without lanes", road_with(("<lanes>", "<!--"), ("</lanes>", "-->")), codes=UNTESTED
    ),
    Attempt("lanes of no width", road_with(('a="3.5"', 'a="0"')), codes=NOT_PASSED),
    # output
    Attempt("the JUnit report over the scenario", scene(), ("--junit", "scenario.xosc"), (USAGE,)),
    Attempt("the JUnit report over the road", scene(), ("--junit", "straight.xodr"), (USAGE,)),
    Attempt("results into the scenario", scene(), ("--out", "scenario.xosc"), (USAGE,)),
    Attempt(
        "a JUnit report into a folder",
        lambda folder: ((folder / "report").mkdir(), scene()(folder))[1],
        ("--junit", "report"),
        (USAGE,),
    ),
    # with SUMO
    Attempt("the scene with SUMO", scene(), ("--world", "sumo"), (FAILED,)),
    Attempt(
        "the scene with SUMO's driver",
        scene(),
        ("--world", "sumo"),
        (PASSED,),
        sut="sumo",
    ),
    Attempt("SUMO's driver without SUMO", scene(), sut="sumo", codes=NOT_PASSED),
]


@pytest.mark.parametrize("attempt", [pytest.param(each, id=each.name) for each in ATTEMPTS])
def test_an_attempt_gets_its_exit_code(
    attempt: Attempt, command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    target = attempt.build(tmp_path)
    options: list[object] = ["--sut", attempt.sut, "--timestep", "0.1"]
    options += [] if "--max-time" in attempt.options else ["--max-time", "20"]
    options += [] if "--world" in attempt.options else ["--world", "kinematic"]
    answer = command("xosc-run", target, *options, *attempt.options)
    assert answer.code in attempt.codes, answer
    if answer.code:
        assert (answer.out + answer.err).strip(), "an exit code without a word"


@pytest.mark.parametrize("timestep", [0.01, 0.05, 0.1])
@pytest.mark.parametrize("way", [0.0, 0.001])
def test_an_ego_that_its_system_freezes_is_no_pass(
    timestep: float, way: float, command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ego = "observation.ego"
    path = answering(f"Pose({ego}.x + {way}, {ego}.y, {ego}.h)")(tmp_path)
    options = ("--world", "kinematic", "--timestep", timestep, "--max-time", 2)
    assert command("xosc-run", path, "--sut", OWN, *options).code == INCONCLUSIVE


# attempts of several steps ------------------------------------------------------------------------


class Batch:
    """A batch of a folder that two calls of xosc-run make: by default of a scene that passes."""

    def __init__(self, command: Command, folder: Path) -> None:
        self._command, self.out, self.files = command, folder / "out", folder / "files"
        scenario(self.files, "sound", **SOUND)  # type: ignore[arg-type]

    def run(self, *options: object, sut: str = "none", out: bool = True) -> Answer:
        fixed = ["--sut", sut, "--timestep", "0.1", "--max-time", "20", "--world", "kinematic"]
        fixed += ["--out", str(self.out)] if out else []
        return self._command("xosc-run", self.files, *fixed, *options)


@pytest.fixture
def batch(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Batch:
    monkeypatch.chdir(tmp_path)
    return Batch(command, tmp_path)


def collide(batch: Batch, name: str = "sound") -> None:
    scenario(batch.files, name, stop=10.0)


Step = Callable[[Batch], object]


def in_out(name: str, text: str) -> Step:
    return lambda batch: (batch.out / name).write_text(text, encoding="utf-8")


def forged(batch: Batch) -> None:
    """A failed run that its result calls a pass."""
    result = batch.out / "bad" / "result.json"
    result.write_text(result.read_text().replace('"failed"', '"passed"'))
    journal = batch.out / "runs.jsonl"
    journal.write_text(journal.read_text().replace('"failed"', '"passed"'))


def cut_short(batch: Batch) -> None:
    journal = batch.out / "runs.jsonl"
    journal.write_bytes(journal.read_bytes()[:-40])


RESUMED = [
    ("a file that collides now", lambda b: None, collide, FAILED),
    ("a file that was added", lambda b: None, lambda b: collide(b, "more"), FAILED),
    ("a file that is gone", lambda b: collide(b, "more"),
        lambda b: (b.files / "more.xosc").unlink(), USAGE),
    ("no file is left", lambda b: None, lambda b: (b.files / "sound.xosc").unlink(), USAGE),
    ("an empty journal", lambda b: collide(b, "bad"), in_out("runs.jsonl", ""), FAILED),
    ("half a line in the journal", lambda b: collide(b, "bad"), cut_short, FAILED),
    ("a journal of words", lambda b: collide(b, "bad"), in_out("runs.jsonl", "all passed\n"),
        FAILED),
    ("a forged pass", lambda b: collide(b, "bad"), forged, FAILED),
    ("settings that are no JSON", lambda b: collide(b, "bad"), in_out("batch.json", "{"), USAGE),
    ("a road that ends the way", lambda b: None,
        lambda b: (b.files / "straight.xodr").write_text("<OpenDRIVE/>"), INVALID),
]  # fmt: skip


@pytest.mark.parametrize(
    ("before", "between", "code"), [pytest.param(*row[1:], id=row[0]) for row in RESUMED]
)
def test_a_resumed_batch_gets_its_exit_code(
    before: Step, between: Step, code: int, batch: Batch
) -> None:
    before(batch)
    batch.run()
    between(batch)
    answer = batch.run("--resume")
    assert answer.code == code, answer


@pytest.mark.parametrize(
    "options",
    [
        ("--fail-if", "min_ttc<1000"),
        ("--least", "ego_seconds=100"),
        ("-p", "Gap=5"),
        ("--only", "0"),
        ("--seed", 5),
        ("--repeat", 2),
    ],
    ids=str,
)
def test_a_resumed_batch_with_another_option_is_no_pass_of_the_old_runs(
    options: tuple[object, ...], batch: Batch
) -> None:
    assert batch.run().code == PASSED
    fresh = batch.run(*options, out=False)
    resumed = batch.run("--resume", *options)
    assert resumed.code in (USAGE, fresh.code), resumed


AGAINST: list[tuple[str, Step, Sequence[int]]] = [
    ("an empty folder", lambda b: (b.files.parent / "old").mkdir(), (USAGE,)),
    ("nothing", lambda b: None, (USAGE, INVALID)),
    ("a file", lambda b: (b.files.parent / "old").write_text("{}"), (USAGE, INVALID)),
]  # fmt: skip


@pytest.mark.parametrize(
    ("before", "codes"), [pytest.param(*row[1:], id=row[0]) for row in AGAINST]
)
def test_a_comparison_with_no_batch_is_refused(
    before: Step, codes: Sequence[int], batch: Batch
) -> None:
    collide(batch)
    before(batch)
    answer = batch.run("--against", "old", "--fail-if", "new-failure")
    assert answer.code in codes, answer


def test_a_comparison_with_a_batch_of_other_files_finds_the_failure_new(batch: Batch) -> None:
    assert batch.run().code == PASSED
    batch.out.rename("old")
    collide(batch, "other")
    answer = batch.run("--against", "old", "--fail-if", "new-failure")
    assert answer.code == FAILED, answer


def test_results_in_the_way_are_no_verdict(batch: Batch) -> None:
    assert batch.run().code == PASSED
    collide(batch)
    assert batch.run().code == USAGE


@pytest.mark.parametrize(
    "name", ["runs.jsonl", "batch.json", "runs.parquet", "work.json", "sound/result.json"]
)
@pytest.mark.parametrize("option", ["--junit", "--osi"])
def test_a_report_in_the_place_of_the_batchs_own_file_is_refused(
    option: str, name: str, batch: Batch
) -> None:
    answer = batch.run(option, batch.out / name)
    assert answer.code == USAGE
    assert "name another" in answer.err
    assert not batch.out.exists()


def test_a_stem_that_was_added_is_listed_once(batch: Batch) -> None:
    assert batch.run().code == PASSED
    scenario(batch.files / "more", "sound", **SOUND)  # type: ignore[arg-type]
    answer = batch.run("--resume")
    assert answer.code == PASSED, answer
    names = [
        json.loads(line)["job"]["name"]
        for line in (batch.out / "runs.jsonl").read_text().splitlines()
    ]
    assert len(names) == len(set(names)) == 2
    listed = pq.read_table(batch.out / "runs.parquet")
    assert len(set(listed["file"].to_pylist())) == listed.num_rows == 2


def test_criteria_of_a_resumed_batch_are_judged_anew(batch: Batch) -> None:
    scenario(batch.files, "judged", **SOUND)  # type: ignore[arg-type]
    path, end = batch.files / "judged.xosc", at_time(3.0, "end")
    judge = criterion("DrivenDistanceTest", "distance_success", "1000")
    path.write_text(path.read_text().replace(end, end + judge))
    assert batch.run().code == FAILED
    result, journal = batch.out / "judged" / "result.json", Records(batch.out / "runs.jsonl")
    values = json.loads(result.read_text())
    values |= {"verdict": "passed", "reasons": [], "criteria": []}
    values["evidence"] = [each for each in values["evidence"] if each["name"] != "criteria"]
    result.write_text(json.dumps(values))
    entries = journal.read().records
    for entry in (each for each in entries if each["job"]["name"] == "judged"):
        entry |= {"state": "passed", "exit_code": 0, "message": "", "criteria": []}
        entry["evidence"] = values["evidence"]
        entry["files"] = digests(result.parent)
    journal.path.unlink()
    journal.add(entries)
    answer = batch.run("--resume")
    assert answer.code == FAILED, answer
