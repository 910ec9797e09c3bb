"""Euro NCAP, implementation 2023: AEB car-to-car with points, AEB VRU without, as the public
OSC-NCAP-scenarios have them.

Points and criteria of car-to-car tests are those of the assessment protocol; it publishes the
colour bands of impact speeds as a figure, and in numbers for 50 km/h only. The assessment protocol
for vulnerable road users was not found in a public text, so these tests have no points.
"""

from __future__ import annotations

from runner.judging.assessment.protocol import (
    Absent,
    AssessmentProfile,
    Column,
    NoContact,
    ProtocolTest,
    SpeedBands,
    SpeedReduction,
    Unassessed,
)

SUMMARY = "Euro NCAP, implementation 2023: AEB car-to-car (points), AEB VRU (outcomes)"

_SPEED, _OVERLAP = "Ego_speed_kph", "Overlap"
_AT_50 = {50.0: ((5.0, "green"), (15.0, "yellow"), (30.0, "orange"), (40.0, "brown"))}
"""Protocol 3.3.2: impact speeds of CCRs and CCRb tests at 50 km/h"""
_OVERLAPS = {-50.0: 1.0, -75.0: 1.0, 100.0: 2.0, 75.0: 1.0, 50.0: 1.0}
"""Protocol 3.3.2: the score at 100 % counts twice"""
_CCRS = {
    10.0: 1.0,
    15.0: 2.0,
    20.0: 2.0,
    25.0: 2.0,
    30.0: 2.0,
    35.0: 2.0,
    40.0: 1.0,
    45.0: 1.0,
    50.0: 1.0,
}
_CCRM = {
    **dict.fromkeys((30.0, 35.0, 40.0, 45.0, 50.0, 55.0, 60.0), 1.0),
    **dict.fromkeys((65.0, 70.0, 75.0, 80.0), 2.0),
}
_TURNS, _ONCOMING = dict.fromkeys((10.0, 15.0, 20.0), 1.0), dict.fromkeys((30.0, 45.0, 60.0), 1.0)
_REDUCTION = SpeedReduction(((20.0, 1.0), (10.0, 0.5)), _SPEED)
_WARNING = "the test rates a warning and the driver's braking after it, which are not simulated"
_TURNING = "the ego turns on the protocol's path: a system that brakes only acts on it"


def _vru(name: str, title: str, files: str, remark: str = "") -> ProtocolTest:
    return ProtocolTest(
        name,
        title,
        "AEB/LSS VRU test protocol 4.5.1",
        f"AEB_VRU_{files}",
        NoContact(),
        remark=remark,
    )


PROFILE = AssessmentProfile(
    title="Euro NCAP, implementation 2023: autonomous emergency braking",
    sources=(
        ("Euro NCAP, Assessment Protocol – Safety Assist – Collision Avoidance, version "
        "10.4.1, February 2024, section 3.3"),
        ("Euro NCAP, Test Protocol – AEB Car-to-Car systems, version 4.3.1, "
        "February 2024, section 8.2"),
        ("Euro NCAP, Test Protocol – AEB/LSS VRU systems, version 4.5.1, February 2024 (names "
        "of the tests)"),
        "Scenario files: github.com/vectorgrp/OSC-NCAP-scenarios (MPL-2.0)",
    ),
    columns=(
        Column("test speed (km/h)", (_SPEED,)),
        Column("target speed (km/h)",
            ("GVT_init_speed_kph", "Target_finalSpeed_kph", "VRU_finalSpeed_kph")),
        Column("overlap (%)", (_OVERLAP,)),
    ),
    tests=(
        # The first pattern that fits counts: narrower ones stand before wider ones.
        ProtocolTest("CCRs FCW", "Car-to-car rear stationary, warning", "3.3.2", "C2C_CCRs_FCW",
            Unassessed(_WARNING)),
        ProtocolTest(
            "CCRs", "Car-to-car rear stationary", "3.3.2", "C2C_CCRs?_",
            SpeedBands(_AT_50, _SPEED), 1.0, {_SPEED: _CCRS, _OVERLAP: _OVERLAPS},
        ),
        ProtocolTest(
            "CCRm", "Car-to-car rear moving", "3.3.2", "C2C_CCRm_",
            SpeedBands({}, _SPEED, relative=True), 1.0, {_SPEED: _CCRM, _OVERLAP: _OVERLAPS},
        ),
        ProtocolTest(
            "CCRb", "Car-to-car rear braking", "3.3.2", "C2C_CCRb_",
            SpeedBands(_AT_50, _SPEED), 1.0,
            {"GVT_headway": {12.0: 1.0, 40.0: 1.0}, "GVT_deceleration": {2.0: 1.0, 6.0: 1.0}},
        ),
        ProtocolTest(
            "CCFtap", "Car-to-car front turn across path", "3.3.3", "C2C_CCFtap_",
            NoContact(), 1.0, {_SPEED: _TURNS, "Target_finalSpeed_kph": _ONCOMING}, _TURNING,
        ),
        ProtocolTest(
            "CCFhos", "Car-to-car front head-on straight", "3.3.5", "C2C_CCFhos_",
            _REDUCTION, 0.5, {_SPEED: {50.0: 1.0, 70.0: 1.0}},
        ),
        ProtocolTest(
            "CCFhol", "Car-to-car front head-on lane change", "3.3.5", "C2C_CCFhol_",
            _REDUCTION, 0.5, {_SPEED: {50.0: 1.0, 70.0: 1.0}},
        ),
        _vru("CPFA-50", "Pedestrian, farside adult", "CPFA"),
        _vru("CPNCO-50", "Pedestrian, nearside child, obstructed", "CPNCO"),
        _vru("CPNA-75", "Pedestrian, nearside adult", "CPNA-75"),
        _vru("CPNA-25", "Pedestrian, nearside adult", "CPNA"),
        _vru("CPLA-25", "Pedestrian, longitudinal adult", "CPLA-25"),
        _vru("CPLA-50", "Pedestrian, longitudinal adult", "CPLA"),
        _vru("CPRA/Cm", "Pedestrian, reverse, moving", "CPRA_Cm", "the ego reverses"),
        _vru("CPRA/Cs", "Pedestrian, reverse, stationary", "CPRA_Cs", "the ego reverses"),
        _vru("CPTA-50", "Pedestrian, turning", "CPTA", _TURNING),
        _vru("CBNAO-50", "Bicyclist, nearside, obstructed", "CBNAO"),
        _vru("CBNA-50", "Bicyclist, nearside", "CBNA"),
        _vru("CBFA-50", "Bicyclist, farside", "CBFA"),
        _vru("CBLA-25", "Bicyclist, longitudinal", "CBLA-25"),
        _vru("CBLA-50", "Bicyclist, longitudinal", "CBLA"),
        _vru("CMFtap", "Motorcyclist, front turn across path", "CMFtap", _TURNING),
    ),
    absent=(
        Absent("CCCscp, AEB", 2.0, "the public files have no crossing tests"),
        Absent("CCCscp, FCW", 1.0, "the public files have no crossing tests"),
        Absent("CCRs, FCW", 0.5, _WARNING),
        Absent("Human-machine interface", 0.5,
            "belts, haptic warnings and displays are not simulated"),
        Absent("AEB VRU, points", 0.0,
            "the assessment protocol for vulnerable road users was not found in a public text"),
        Absent("Lane support systems", 3.0, "the public files have no tests of lane support"),
    ),
    assumptions=(
        "The impact speed of a test without contact is 0 and green.",
        "Correction factors of verification tests are not applied: every test point is simulated.",
        ("Preconditions outside of the simulation (fitment, switching off, whiplash score, "
        "dossiers) are not examined."),
        "Light and weather of the files make no difference to systems that do not read them.",
        ("Files with one parameter set repeat points of the variation files; of several runs "
        "of a point the worst counts."),
    ),
)  # fmt: skip
"""The protocol as data"""
