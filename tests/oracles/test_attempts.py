"""Attempts to get exit code 0 where nothing was tested: each has its exit code and its reason.

Runs are kinematic.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.commands import Command
from tests.oracles.attempts import (
    BARE,
    BOX,
    BRAKE,
    CENTRE,
    EGO,
    END,
    ERROR,
    FAILED,
    FAR,
    HEAD,
    INVALID,
    LEAD,
    NOT_PASSED,
    OWN,
    PASSED,
    PEDESTRIAN,
    REFUSED,
    RENAMED,
    SPEED,
    STATE,
    UNTESTED,
    USAGE,
    Attempt,
    activate,
    at,
    box,
    catalogue,
    folder_with,
    gone,
    judged,
    of,
    part,
    private,
    raw,
    scene,
    system,
    time,
    value,
    varied,
    waits,
)
from tests.runner.files import HEADER, at_time, car, place, speed_action, story

ATTEMPTS = [
    # the scene itself
    Attempt("the scene collides", scene(), codes=(FAILED,)),
    Attempt("a brake that tests something", waits(time(0.5)), codes=(PASSED,)),
    # placement
    Attempt("ego never placed", scene(init=LEAD)),
    Attempt("ego never placed, cas", scene(init=LEAD), sut="cas"),
    Attempt(
        "ego with a speed and no place",
        scene(init=LEAD + f'<Private entityRef="Ego">{speed_action(9)}</Private>'),
    ),
    Attempt(
        "partner never placed, with events", scene(init=EGO, stories=story("Lead", [(1, BRAKE)]))
    ),
    Attempt(
        "partner with a speed and no place",
        scene(init=EGO + f'<Private entityRef="Lead">{speed_action(9)}</Private>'),
    ),
    Attempt("nobody placed", scene(*BARE)),
    Attempt("nobody placed, cas", scene(*BARE), sut="cas"),
    Attempt(
        "no entities",
        scene(*BARE, ("<Entities>", "<Entities><!--"), ("</Entities>", "--></Entities>")),
    ),
    Attempt("ego 500 m above the road", scene(init=at("Ego", 100, -1.75, 500) + LEAD)),
    Attempt(
        "ego 500 m above the road, cas", scene(init=at("Ego", 100, -1.75, 500) + LEAD), sut="cas"
    ),
    Attempt("ego 50 m below the road", scene(init=at("Ego", 100, -1.75, -50) + LEAD)),
    Attempt("ego 100 km beside the road", scene(init=at("Ego", 100, 1e5) + LEAD)),
    Attempt("ego 100 km beside the road, cas", scene(init=at("Ego", 100, 1e5) + LEAD), sut="cas"),
    Attempt(
        "ego beside the road, event",
        scene(init=at("Ego", 100, 1e5) + LEAD, stories=story("Lead", [(0, BRAKE)])),
    ),
    Attempt("ego at NaN", scene(init=at("Ego", "NaN", 0) + LEAD)),
    Attempt("ego at INF", scene(init=at("Ego", "INF", 0) + LEAD)),
    Attempt("ego beyond the end of the road", scene(init=place("Ego", 1e6, 20) + LEAD)),
    Attempt("ego before the start of the road", scene(init=place("Ego", -500, 20) + LEAD)),
    Attempt("ego on a lane that is not there", scene(init=place("Ego", 100, 20, lane=-9) + LEAD)),
    Attempt(
        "ego on the centre lane", scene(init=place("Ego", 100, 20, lane=0) + LEAD), codes=NOT_PASSED
    ),
    Attempt("ego on a road that is not there", scene(('roadId="1"', 'roadId="7"'))),
    Attempt(
        "ego relative to nobody",
        scene(
            (
                '<LanePosition roadId="1" laneId="-1" s="100"/>',
                '<RelativeObjectPosition entityRef="Nobody" dx="1" dy="0"/>',
            )
        ),
    ),
    Attempt(
        "ego relative to itself",
        scene(
            (
                '<LanePosition roadId="1" laneId="-1" s="100"/>',
                '<RelativeObjectPosition entityRef="Ego" dx="1" dy="0"/>',
            )
        ),
    ),
    Attempt("actions for a misspelt ego", scene(('entityRef="Ego"', 'entityRef="Ergo"'))),
    Attempt("an empty Position", scene(('<LanePosition roadId="1" laneId="-1" s="100"/>', ""))),
    Attempt(
        "an empty TeleportAction",
        scene(
            init=EGO.replace(
                '<Position><LanePosition roadId="1" laneId="-1" s="100"/></Position>', ""
            )
            + LEAD
        ),
    ),
    Attempt(
        "ego and partner at one place",
        scene(init=place("Ego", 100, 20) + place("Lead", 100, 20)),
        codes=NOT_PASSED,
    ),
    # removal
    Attempt("ego deleted in Init", scene(init=EGO + LEAD + gone("Ego")), codes=NOT_PASSED),
    Attempt("partner deleted in Init", scene(init=EGO + LEAD + gone("Lead")), codes=NOT_PASSED),
    Attempt("ego deleted at 0", scene(stories=story("Lead", [(0, gone("Ego"))]))),
    Attempt("ego deleted before the contact", scene(stories=story("Lead", [(1, gone("Ego"))]))),
    Attempt(
        "ego deleted before the contact, cas",
        scene(stories=story("Lead", [(1, gone("Ego"))])),
        sut="cas",
    ),
    Attempt(
        "a deleted entity that nobody declared", scene(stories=story("Lead", [(1, gone("Nobody"))]))
    ),
    # boxes
    Attempt("box of no size", box('width="0" length="0" height="0"')),
    Attempt("box of 1e-300 m", box('width="1e-300" length="1e-300" height="1e-300"')),
    Attempt("box of negative size", box('width="-2" length="-5" height="-1.5"')),
    Attempt("box of NaN", box('width="NaN" length="5" height="1.5"')),
    Attempt("box of INF", box('width="INF" length="5" height="1.5"')),
    Attempt("box without width", box('length="5" height="1.5"'), codes=NOT_PASSED),
    Attempt("box without height", box('width="2" length="5" height="0"'), codes=NOT_PASSED),
    Attempt("box of words", box('width="wide" length="5" height="1.5"')),
    Attempt(
        "box 1,000 km beside",
        box('width="2" length="5" height="1.5"', '<Center x="1.5" y="1000000" z="0.75"/>'),
        codes=NOT_PASSED,
    ),
    Attempt(
        "ego's box 1 km above",
        scene(entities=[car("Ego").replace('z="0.75"', 'z="1000"'), car("Lead")]),
    ),
    Attempt(
        "ego's box 30 m beside",
        scene(entities=[car("Ego").replace('y="0"', 'y="30"'), car("Lead")]),
    ),
    Attempt(
        "no BoundingBox", scene((f"<BoundingBox>{CENTRE}{BOX}</BoundingBox>", "")), codes=NOT_PASSED
    ),
    # time
    Attempt("max-time 0", scene(), ("--max-time", 0)),
    Attempt("max-time less than a step", scene(), ("--max-time", 0.01)),
    Attempt("max-time negative", scene(), ("--max-time", -1), (USAGE,)),
    Attempt("max-time NaN", scene(), ("--max-time", "nan"), (USAGE,)),
    Attempt("timestep 0", scene(), ("--timestep", 0), (USAGE,)),
    Attempt("timestep negative", scene(), ("--timestep", -0.1), (USAGE,)),
    Attempt("timestep NaN", scene(), ("--timestep", "nan"), (USAGE,)),
    Attempt("timestep beyond the run", scene(), ("--timestep", 1000), NOT_PASSED),
    Attempt(
        "steps of 1 s through a standing car",
        scene(init=place("Ego", 100, 20) + place("Lead", 169.6, 0)),
        ("--timestep", 1),
        NOT_PASSED,
    ),
    Attempt("stop at 0", scene(stop=0.0)),
    Attempt("stop at 0, cas", scene(stop=0.0), sut="cas"),
    Attempt("stop at 1e-9", scene(stop=1e-9)),
    Attempt("stop at a negative time", scene(stop=-5.0)),
    Attempt("stop before the event", scene(stop=1.0, stories=story("Lead", [(5, BRAKE)]))),
    Attempt(
        "limit before the event", scene(stories=story("Lead", [(5, BRAKE)])), ("--max-time", 1)
    ),
    Attempt(
        "stop before the second event",
        scene(stop=1.0, stories=story("Lead", [(0, speed_action(10)), (5, BRAKE)])),
        codes=UNTESTED,
    ),
    Attempt(
        "stop as the ego stands still",
        scene(
            (END, of("Ego", '<StandStillCondition duration="0"/>')),
            init=place("Ego", 100, 0) + LEAD,
        ),
    ),
    # triggers
    Attempt("trigger at 1e9 s", waits(time(1e9))),
    Attempt("trigger at NaN", waits(time("NaN"))),
    Attempt("trigger at INF", waits(time("INF"))),
    Attempt("trigger at a word", waits(time("soon"))),
    Attempt("trigger before the start", waits(time(0, "lessThan"))),
    Attempt("trigger with a delay of 1e300 s", waits(time(0, delay="1e300"))),
    Attempt("trigger with a negative delay", waits(time(1e9, delay="-1e9")), codes=UNTESTED),
    Attempt("trigger of an unknown rule", waits(time(0, "about"))),
    Attempt("trigger of an unknown edge", waits(time(0, edge="sideways"))),
    Attempt("falling edge that never falls", waits(time(0, edge="falling"))),
    Attempt("rising edge at 0", waits(time(0, edge="rising"))),
    Attempt("speed above 1e9 m/s", waits(of("Ego", SPEED.format(1e9)))),
    Attempt("speed of nobody", waits(of("Nobody", SPEED.format(1)))),
    Attempt(
        "trigger without entities",
        waits(of("Ego", SPEED.format(1)).replace('<EntityRef entityRef="Ego"/>', "")),
    ),
    Attempt("condition without a kind", waits(of("Ego", ""))),
    Attempt(
        "parameter of another variant",
        waits(value('<ParameterCondition parameterRef="Gap" value="7" rule="equalTo"/>')),
    ),
    Attempt(
        "parameter that nobody declared",
        waits(value('<ParameterCondition parameterRef="Gapp" value="7" rule="equalTo"/>')),
    ),
    Attempt(
        "variable that nobody declared",
        waits(value('<VariableCondition variableRef="V" value="7" rule="equalTo"/>')),
    ),
    Attempt(
        "user value that nobody sets",
        waits(value('<UserDefinedValueCondition name="u" value="7" rule="equalTo"/>')),
    ),
    Attempt(
        "state of an unknown event", waits(value(STATE.format("event", "nothing", "completeState")))
    ),
    Attempt(
        "an event that waits for its own end",
        waits(value(STATE.format("event", "event0", "completeState"))),
    ),
    Attempt(
        "act that never starts",
        scene((at_time(0), time(1e9)), init=FAR, stop=3.0, stories=story("Lead", [(1, BRAKE)])),
    ),
    Attempt(
        "act that stops at 0",
        scene(
            ("</StartTrigger></Act>", f"</StartTrigger><StopTrigger>{time(0)}</StopTrigger></Act>"),
            init=FAR,
            stop=3.0,
            stories=story("Lead", [(1, BRAKE)]),
        ),
    ),
    Attempt(
        "stop trigger that waits for an element that never starts",
        scene(
            (END, value(STATE.format("event", "event0", "completeState"))),
            init=FAR,
            stories=story("Lead", [(1e6, BRAKE)]),
        ),
        ("--max-time", 3),
    ),
    Attempt(
        "traffic light that is not there",
        waits(value('<TrafficSignalCondition name="77" state="red"/>')),
    ),
    # storyboard
    Attempt(
        "no actors",
        scene(
            ('<EntityRef entityRef="Lead"/></Actors>', "</Actors>"),
            init=FAR,
            stop=3.0,
            stories=story("Lead", [(1, BRAKE)]),
        ),
    ),
    Attempt(
        "an actor that nobody declared",
        scene(init=FAR, stop=3.0, stories=story("Nobody", [(1, BRAKE)])),
    ),
    Attempt("an empty action", waits(time(0.5), "")),
    Attempt("an empty private action", waits(time(0.5), "<PrivateAction/>")),
    Attempt("an unknown action", waits(time(0.5), private("<FlyAction/>"))),
    Attempt("a story without events", scene(init=FAR, stop=3.0, stories=story("Lead", []))),
    Attempt("an empty story", scene(init=FAR, stop=3.0, stories='<Story name="s"/>')),
    Attempt(
        "only a user's command",
        waits(
            time(0.5),
            "<UserDefinedAction><CustomCommandAction "
            'type="x">no</CustomCommandAction></UserDefinedAction>',
        ),
    ),
    Attempt("no Storyboard", scene(("<Storyboard>", "<!--"), ("</Storyboard>", "-->"))),
    Attempt("no Init", scene(("<Init>", "<!--"), ("</Init>", "-->"))),
    Attempt(
        "an empty Storyboard",
        scene(("<Storyboard>", "<Storyboard><!--"), ("</Storyboard>", "--></Storyboard>")),
    ),
    Attempt(
        "two storyboards",
        scene(
            (
                "<Storyboard>",
                f"<Storyboard><Init><Actions>{FAR}</Actions></Init><StopTrigger>{at_time(1)}</StopTrigger></Storyboard><Storyboard>",
            )
        ),
        codes=NOT_PASSED,
    ),
    Attempt("a misspelt Storyboard", scene(("Storyboard>", "Storybord>")), codes=NOT_PASSED),
    Attempt(
        "a misspelt Event",
        scene(
            ("<Event ", "<Evnt "),
            ("</Event>", "</Evnt>"),
            init=FAR,
            stories=story("Lead", [(1, BRAKE)]),
        ),
    ),
    # who is the ego
    Attempt("--ego of nobody", scene(), ("--ego", "Nobody"), (USAGE,)),
    Attempt("--ego in capitals", scene(), ("--ego", "EGO"), (USAGE,)),
    Attempt("--ego of no name", scene(), ("--ego", ""), (USAGE,)),
    Attempt("--ego with a blank", scene(), ("--ego", "Ego "), (USAGE,)),
    Attempt("no ego, none", scene(RENAMED), codes=NOT_PASSED),
    Attempt("no ego, cas", scene(RENAMED), codes=NOT_PASSED, sut="cas"),
    Attempt("a pedestrian as ego", scene(entities=[PEDESTRIAN, car("Lead")]), codes=NOT_PASSED),
    Attempt(
        "a pedestrian as ego, cas",
        scene(entities=[PEDESTRIAN, car("Lead")]),
        codes=NOT_PASSED,
        sut="cas",
    ),
    Attempt(
        "two egos of one name",
        scene(entities=[car("Ego"), car("Ego"), car("Lead")]),
        codes=NOT_PASSED,
    ),
    Attempt("partner as ego", scene(), ("--ego", "Lead"), (FAILED,)),
    Attempt(
        "an ego that stands, cas",
        scene(init=place("Ego", 100, 0) + LEAD),
        codes=(PASSED,),
        sut="cas",
    ),
    # controllers and systems
    Attempt(
        "system switched off",
        scene(
            init=place("Ego", 100, 20, more=activate("false", "false")) + place("Lead", 160, 19),
            stop=3.0,
        ),
        sut="cas",
    ),
    Attempt(
        "system switched off before a contact",
        scene(init=place("Ego", 100, 20, more=activate("false", "false")) + LEAD),
        codes=NOT_PASSED,
        sut="cas",
    ),
    Attempt("system that is not there", scene(), sut="cass", codes=(USAGE,)),
    Attempt("system with an argument that it lacks", scene(), sut="cas:range=3", codes=(USAGE,)),
    Attempt("system with a negative range", scene(), sut="cas:sensor_range=-1", codes=(USAGE,)),
    Attempt("system with a range of NaN", scene(), sut="cas:sensor_range=nan", codes=(USAGE,)),
    Attempt("system of no name", scene(), sut="", codes=(USAGE,)),
    Attempt("module that is not there", scene(), sut="no_such_module:System", codes=(USAGE,)),
    Attempt("class that is not there", system("x = 1\n"), sut=OWN, codes=(USAGE,)),
    Attempt("class without control", system("class System:\n    pass\n"), sut=OWN, codes=(USAGE,)),
    Attempt(
        "system whose file ends the process",
        system("raise SystemExit(0)\n"),
        sut=OWN,
        codes=(USAGE, ERROR),
    ),
    Attempt(
        "system that ends the process",
        system(f"{HEAD}        raise SystemExit(0)\n"),
        sut=OWN,
        codes=(ERROR,),
    ),
    Attempt(
        "system that fails",
        system(f"{HEAD}        raise ValueError('no')\n"),
        sut=OWN,
        codes=(ERROR,),
    ),
    Attempt(
        "system that answers None", system(f"{HEAD}        return None\n"), sut=OWN, codes=(ERROR,)
    ),
    Attempt(
        "system that answers a number",
        system(f"{HEAD}        return 3.0\n"),
        sut=OWN,
        codes=(ERROR,),
    ),
    # criteria and limits
    Attempt("misspelt criterion", judged("RunningStopTestt")),
    Attempt(
        "misspelt criterion with a value", judged("DrivenDistnceTest", "distance_success", "1000")
    ),
    Attempt(
        "sound criterion that fails",
        judged("DrivenDistanceTest", "distance_success", "1000"),
        codes=(FAILED,),
    ),
    Attempt(
        "criterion after the end",
        judged("DrivenDistanceTest", "distance_success", "1000", 1e9),
        codes=NOT_PASSED,
    ),
    Attempt(
        "criterion with a blank",
        judged("DrivenDistanceTest ", "distance_success", "1000"),
        codes=NOT_PASSED,
    ),
    Attempt("criterion without its value", judged("DrivenDistanceTest")),
    Attempt(
        "criterion in lower case",
        judged("drivendistancetest", "distance_success", "1000"),
        codes=NOT_PASSED,
    ),
    *(
        Attempt(f"limit {text!r}", scene(init=FAR, stop=1.0), ("--fail-if", text), (USAGE,))
        for text in (
            "min_tcc<1",
            "min_ttc",
            "min_ttc<",
            "min_ttc<nan",
            "min_ttc<one",
            "min_ttc=1",
            "min_ttc<-1",
            "",
            "<1",
            "rs",
            "new-failure",
            "min_ttc>1e400",
        )
    ),
    Attempt(
        "a limit that the scene breaks", scene(stop=1.0), ("--fail-if", "min_ttc<100"), (FAILED,)
    ),
    Attempt(
        "a limit without values",
        scene(init=FAR, stop=1.0),
        ("--fail-if", "impact_speed>1"),
        (PASSED,),  # a run without an impact keeps it
    ),
    # parameters
    Attempt("option for an undeclared parameter", scene(), ("-p", "Gapp=100"), (USAGE,)),
    Attempt("parameter without a value", scene(), ("-p", "Gap"), (USAGE,)),
    Attempt("parameter of a word", scene(), ("-p", "Gap=wide"), NOT_PASSED),
    Attempt("parameter of nothing", scene(), ("-p", "Gap="), NOT_PASSED),
    Attempt("parameter of NaN", scene(), ("-p", "Gap=NaN"), NOT_PASSED),
    Attempt("parameter in lower case", scene(), ("-p", "gap=5"), (USAGE,)),
    Attempt("reference to an unknown parameter", scene(("$Lead_Speed", "$Led_Speed"))),
    Attempt("expression that divides by 0", scene(("${100 + $Gap}", "${100 / 0}"))),
    Attempt("a speed of NaN", scene(init=place("Ego", 100, "NaN") + LEAD)),
    Attempt("a speed of INF", scene(init=place("Ego", 100, "INF") + LEAD)),
    # files
    Attempt("no file", lambda folder: folder / "none.xosc", codes=(INVALID,)),
    Attempt("a name of nothing", lambda folder: "", codes=(USAGE,)),
    Attempt("an empty file", raw(""), codes=(INVALID,)),
    Attempt("a file of zeros", raw(bytes(500)), codes=(INVALID,)),
    Attempt("no XML", raw("scenario: cut in"), codes=(INVALID,)),
    Attempt("an empty OpenSCENARIO", raw("<OpenSCENARIO/>"), codes=REFUSED),
    Attempt("another root", raw("<OpenDRIVE/>"), codes=REFUSED),
    Attempt("the first half", part(0, 50), codes=(INVALID,)),
    Attempt("the second half", part(50, 100), codes=(INVALID,)),
    Attempt(
        "a scenario twice in its file",
        lambda folder: raw(scene()(folder).read_text() * 2)(folder),
        codes=(INVALID,),
    ),
    Attempt(
        "a road as scenario",
        lambda folder: (scene()(folder), folder / "straight.xodr")[1],
        codes=REFUSED,
    ),
    Attempt(
        "a catalogue as scenario",
        raw(f'<OpenSCENARIO>{HEADER}<Catalog name="c"/></OpenSCENARIO>'),
        codes=UNTESTED,
    ),
    Attempt("a road that is not there", scene(("straight.xodr", "crooked.xodr")), codes=REFUSED),
    Attempt(
        "an empty road",
        lambda folder: (scene()(folder), (folder / "straight.xodr").write_text(""))[0],
        codes=REFUSED,
    ),
    Attempt(
        "a road without roads",
        lambda folder: (scene()(folder), (folder / "straight.xodr").write_text("<OpenDRIVE/>"))[0],
        codes=UNTESTED,
    ),
    Attempt("an unknown minor version", scene(('revMinor="3"', 'revMinor="9"')), codes=NOT_PASSED),
    Attempt("an unknown major version", scene(('revMajor="1"', 'revMajor="2"')), codes=NOT_PASSED),
    # catalogues
    Attempt("an entry of a catalogue", catalogue("car"), codes=(FAILED,)),
    Attempt("an entry that is not there", catalogue("bus"), codes=REFUSED),
    Attempt("a catalogue that is not there", catalogue("car", kept=False), codes=REFUSED),
    # batches
    Attempt("an empty folder", lambda folder: folder),
    Attempt("a glob of nothing", lambda folder: folder / "*.xosc", codes=(USAGE, INVALID)),
    Attempt("a sound folder", folder_with(), codes=(PASSED,)),
    Attempt(
        "a folder with a broken file",
        folder_with(raw("<OpenSCENARIO>", "z.xosc")),
        codes=(INVALID,),
    ),
    Attempt("a folder with a collision", folder_with(scene()), codes=(FAILED,)),
    Attempt("a folder with a run without ego", folder_with(scene(init=LEAD))),
    Attempt(
        "a folder with a dangling link",
        folder_with(lambda folder: (folder / "z.xosc").symlink_to("nowhere.xosc")),
        codes=NOT_PASSED,
    ),
    Attempt(
        "a folder with a FIFO",
        folder_with(lambda folder: os.mkfifo(folder / "z.xosc")),
        codes=NOT_PASSED,
    ),
    Attempt(
        "a folder with an unreadable folder",
        folder_with(lambda folder: (folder / "locked").mkdir(mode=0)),
        codes=(PASSED,) if os.geteuid() == 0 else NOT_PASSED,  # root reads all
    ),
    Attempt(
        "a folder with a scenario that has an empty Catalog",
        folder_with(scene(("<Storyboard>", '<Catalog name="c"/><Storyboard>'))),
        codes=NOT_PASSED,
    ),
    Attempt(
        "a sound folder and a missing file",
        lambda folder: folder_with()(folder).parent / "b*",
        ("none.xosc",),
        (INVALID, USAGE),
    ),
    Attempt("variation with a collision", varied(40.0, 60.0, 10.0), codes=(FAILED,)),
    Attempt(
        "variation of an unknown parameter", varied(40.0, 60.0, 10.0, name="Gapp"), codes=NOT_PASSED
    ),
    Attempt("variation of an empty range", varied(60.0, 40.0, 10.0), codes=UNTESTED),
    Attempt("variation with steps of 0", varied(40.0, 60.0, 0.0), codes=UNTESTED),
    Attempt(
        "variation of a missing scenario", varied(40.0, 60.0, 10.0, of_file="none"), codes=REFUSED
    ),
    Attempt("--only a set that there is not", varied(40.0, 60.0, 10.0), ("--only", "99"), (USAGE,)),
    Attempt("--only nothing", varied(40.0, 60.0, 10.0), ("--only", ""), (USAGE,)),
    Attempt("--sample 0", varied(40.0, 60.0, 10.0), ("--sample", 0), (USAGE,)),
    Attempt("--repeat 0", scene(), ("--repeat", 0), (USAGE,)),
    Attempt("--jobs 0", scene(), ("--jobs", 0), (USAGE,)),
    Attempt("--resume without a batch", scene(), ("--resume",), (USAGE,)),
    Attempt("--against nothing", scene(), ("--against", "nowhere"), NOT_PASSED),
    Attempt("new failures against nothing", scene(), ("--fail-if", "new-failure"), (USAGE,)),
    Attempt("a world that is not there", scene(), ("--world", "moon"), (USAGE,)),
    Attempt("a seed of a word", scene(), ("--seed", "one"), (USAGE,)),
]

DEFECTS: dict[str, str] = {}
"""Attempts that still pass or end with another exit code, with the reason"""


def test_names_are_unique() -> None:
    names = [attempt.name for attempt in ATTEMPTS]
    assert len(set(names)) == len(names) >= 150
    assert DEFECTS.keys() <= set(names)


@pytest.mark.parametrize(
    "attempt",
    [
        pytest.param(
            attempt,
            id=attempt.name,
            marks=[pytest.mark.xfail(reason=DEFECTS[attempt.name], strict=True)]
            if attempt.name in DEFECTS
            else [],
        )
        for attempt in ATTEMPTS
    ],
)
def test_an_attempt_gets_its_exit_code(
    attempt: Attempt, command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    target = attempt.build(tmp_path)
    options = ["--world", "kinematic", "--sut", attempt.sut, "--timestep", "0.1"]
    if "--max-time" not in attempt.options:
        options += ["--max-time", "20"]
    answer = command("xosc-run", target, *options, *attempt.options)
    assert answer.code in attempt.codes, answer
    if answer.code:
        assert (answer.out + answer.err).strip(), "an exit code without a word"
