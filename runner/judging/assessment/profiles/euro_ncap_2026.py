"""Euro NCAP, implementation 2026: Crash Avoidance, Frontal Collisions and reversing, by the public
OSC-NCAP-scenarios of 2023.

Test points, colour bands and points are those of Euro NCAP's own public rating calculator. Only the
Standard Range is computed: the Extended Range and the Robustness Layers are rated in steps from the
manufacturer's prediction and its verification.
"""

from __future__ import annotations

from collections.abc import Mapping

from runner.judging.assessment.protocol import (
    Absent,
    AssessmentProfile,
    Column,
    NoContact,
    ProtocolCriterion,
    ProtocolTest,
    SpeedBands,
    SpeedReduction,
    Unassessed,
)

SUMMARY = (
    "Euro NCAP, implementation 2026: frontal collisions with cars, motorcycles, pedestrians, "
    "cyclists; reversing (points)"
)

_SPEED, _OVERLAP = "Ego_speed_kph", "Overlap"
_TARGET, _TURNED, _VRU = "GVT_init_speed_kph", "Target_finalSpeed_kph", "VRU_finalSpeed_kph"
_FAST = ((10.0, "yellow"), (20.0, "orange"), (30.0, "brown"))
_BANDS = {
    10.0: (),
    20.0: (),
    30.0: ((10.0, "brown"),),
    40.0: ((10.0, "orange"), (20.0, "brown")),
    **{float(speed): _FAST for speed in range(50, 140, 10)},
}
"""Upper limits of the relative speed at contact by test speed (km/h); a contact is never green"""
_IMPACT = SpeedBands(_BANDS, _SPEED, relative=True, elsewhere="the protocol has no test at {}")
_REDUCTION = SpeedReduction(((20.0, 1.0), (10.0, 0.5)), _SPEED)
_OVERLAPS = (-50.0, -75.0, 100.0, 75.0, 50.0)
"""Overlaps of the files that stand for the impact locations 0 to 100 %"""
# The target drives 60 km/h slower than the ego, and at least 20 km/h.
_MOVING = {float(speed): max(20.0, speed - 60.0) for speed in range(30, 140, 10)}
_WARNING = "the test rates the time of a warning, which is not simulated"
_TURNING = "the ego turns on the protocol's path: a system that brakes only acts on it"
_ONE_PLACE = "the files have one impact location, 50 %; points of the others are listed below"


def _even(*values: float) -> dict[float, float]:
    """Values of a grid that count alike."""
    return dict.fromkeys(map(float, values), 1.0)


def _test(
    name: str, title: str, files: str, points: float, grid: Mapping[str, Mapping[float, float]],
    fixed: Mapping[str, Mapping[float, float] | float] | None = None,
    criterion: ProtocolCriterion = _IMPACT, remark: str = "",
) -> ProtocolTest:  # fmt: skip
    clause = "Frontal Collisions 1.2, section 5.2"
    return ProtocolTest(
        name, title, clause, f"AEB_{files}", criterion, points, grid, remark, fixed or {}
    )


_TO_60 = _even(*range(10, 70, 10))

PROFILE = AssessmentProfile(
    title="Euro NCAP, implementation 2026: crash avoidance",
    sources=(
        ("Euro NCAP, rating calculator 2026, version 5.4.9 (PyPI: euroncap-rating-2026): test "
        "points, colour bands, points"),
        ("Euro NCAP, Protocol – Crash Avoidance – Frontal Collisions, version 1.2, July 2026, "
        "as the calculator cites it"),
        ("Scenario files: github.com/vectorgrp/OSC-NCAP-scenarios (MPL-2.0), made for "
        "implementation 2023"),
    ),
    columns=(
        Column("test speed (km/h)", (_SPEED,)),
        Column("target speed (km/h)", (_TARGET, _TURNED, _VRU)),
        Column("overlap or impact location (%)", (_OVERLAP,)),
    ),
    tests=(
        # The first pattern that fits counts: narrower ones stand before wider ones.
        _test("CCRs FCW", "Car-to-car rear stationary, warning", "C2C_CCRs_FCW", 0.0, {},
            criterion=Unassessed(_WARNING)),
        _test(
            "CCRs", "Car-to-car rear stationary", "C2C_CCRs?_", 1.2,
            {_SPEED: _even(*range(10, 90, 10)), _OVERLAP: _even(*_OVERLAPS)},
        ),
        _test(
            "CCRm", "Car-to-car rear moving", "C2C_CCRm_", 2.4,
            {_SPEED: _even(*_MOVING), _OVERLAP: _even(*_OVERLAPS)}, {_TARGET: _MOVING},
        ),
        _test(
            "CCRb", "Car-to-car rear braking", "C2C_CCRb_", 0.0, {},
            remark="headway and deceleration of the target are not public in numbers, so that no "
                   "run is one of the test points",
        ),
        # Two of the 18 test points that share 2 points: the files have 50 and 70 km/h at 50 %.
        _test(
            "CCFhos", "Car-to-car front head-on straight", "C2C_CCFhos_", 2.0 * 2 / 18,
            {_SPEED: _even(50, 70)},
            criterion=_REDUCTION, remark=_ONE_PLACE,
        ),
        _test(
            "CCFhol", "Car-to-car front head-on lane change", "C2C_CCFhol_", 2.0 * 2 / 18,
            {_SPEED: _even(50, 70)},
            criterion=_REDUCTION, remark=_ONE_PLACE,
        ),
        _test(
            "CCFtap", "Car-to-car front turn across path", "C2C_CCFtap_", 4.0,
            {_SPEED: _even(10, 15, 20), _TURNED: _even(30, 45, 60)}, criterion=NoContact(),
            remark=_TURNING,
        ),
        _test(
            "CMFtap", "Car-to-motorcyclist front turn across path", "VRU_CMFtap", 4.0,
            {_SPEED: _even(10, 15, 20), _TURNED: _even(30, 45, 60)}, criterion=NoContact(),
            remark=_TURNING,
        ),
        _test(
            "CPNA", "Pedestrian, nearside adult, day", "VRU_CPNA", 0.5,
            {_SPEED: _TO_60, _OVERLAP: _even(25, 50, 75)}, {_VRU: 5.0},
        ),
        _test("CPFA", "Pedestrian, farside adult, day", "VRU_CPFA", 0.5,
            {_SPEED: _TO_60, _OVERLAP: _even(50)}, {_VRU: 8.0}),
        _test(
            "CPNCO", "Pedestrian, nearside child, obstructed, day", "VRU_CPNCO", 1.0,
            {_SPEED: _TO_60, _OVERLAP: _even(50)}, {_VRU: 5.0},
        ),
        _test("CPLA FCW", "Pedestrian, longitudinal, warning", "VRU_CPLA-25", 0.0, {},
            criterion=Unassessed(_WARNING)),
        # Six of the 10 test points: the others rate a warning.
        _test(
            "CPLA", "Pedestrian, longitudinal adult, day", "VRU_CPLA", 1.0 * 6 / 10,
            {_SPEED: _TO_60, _OVERLAP: _even(50)}, {_VRU: 5.0},
        ),
        _test(
            "CPTAfs", "Pedestrian, farside turn, same direction", "VRU_CPTAfs", 0.75,
            {_SPEED: _even(10, 15, 20)}, {_VRU: 5.0}, NoContact(), _TURNING,
        ),
        _test(
            "CPTAns", "Pedestrian, nearside turn, same direction", "VRU_CPTAns", 0.25,
            {_SPEED: _even(10)}, {_VRU: 5.0}, NoContact(), _TURNING,
        ),
        _test(
            "CPTAfo", "Pedestrian, farside turn, opposite direction", "VRU_CPTAfo", 0.75,
            {_SPEED: _even(10, 15, 20)}, {_VRU: 5.0}, NoContact(), _TURNING,
        ),
        _test(
            "CPTAno", "Pedestrian, nearside turn, opposite direction", "VRU_CPTA", 0.25,
            {_SPEED: _even(10)}, {_VRU: 5.0}, NoContact(), _TURNING,
        ),
        _test("CBNAO", "Cyclist, nearside, obstructed", "VRU_CBNAO", 1.0, {_SPEED: _TO_60},
            {_VRU: 10.0}, remark=_ONE_PLACE),
        _test("CBNA", "Cyclist, nearside", "VRU_CBNA", 0.5, {_SPEED: _TO_60}, {_VRU: 15.0},
            remark=_ONE_PLACE),
        _test("CBFA", "Cyclist, farside", "VRU_CBFA", 0.5, {_SPEED: _TO_60}, {_VRU: 20.0},
            remark=_ONE_PLACE),
        _test("CBLA FCW", "Cyclist, longitudinal, warning", "VRU_CBLA-25", 0.0, {},
            criterion=Unassessed(_WARNING)),
        # Five of the 9 test points: the others rate a warning.
        _test(
            "CBLA", "Cyclist, longitudinal", "VRU_CBLA", 2.0 * 5 / 9,
            {_SPEED: _even(*range(20, 70, 10)), _OVERLAP: _even(50)}, {_VRU: 15.0},
        ),
        ProtocolTest(
            "CPMRCs", "Pedestrian, reversing, stationary", "Low Speed Collisions 1.2",
            "AEB_VRU_CPRA_Cs", NoContact(), 1.5,
            {_SPEED: _even(4, 8), _OVERLAP: _even(25, 50, 75)}, "the ego reverses",
        ),
        ProtocolTest(
            "CPMRCm", "Pedestrian, reversing, moving", "Low Speed Collisions 1.2",
            "AEB_VRU_CPRA_Cm", NoContact(),
            remark="the ego reverses; the files do not have the protocol's rear gaps",
        ),
    ),
    absent=(
        Absent("CCRb, Standard Range", 1.6,
            "headway and deceleration of the target are not public in numbers"),
        Absent("CCFhos, CCFhol, other test points", 4.0 * 16 / 18,
            "the public files have 50 and 70 km/h at 50 %"),
        Absent("CCCscp, CMCscp", 12.0, "the public files have no crossing tests"),
        Absent("CMRs, CMRb", 2.8, "the public files have no motorcycle ahead"),
        Absent("CPNA, CPFA, CPNCO, CPLA at night", 3.0, "the public files are by day"),
        Absent("CPLA by day and CBLA, warning", 0.4 + 2.0 * 4 / 9, _WARNING),
        Absent("CBTA", 2.0, "the public files have no turning test with a cyclist"),
        Absent("CBNA, CBFA, CBNAO, second impact location", 2.0,
            "the public files have one impact location, 50 %"),
        Absent("Extended Range of frontal collisions", 6.0,
            "rated in steps from predictions and their verification"),
        Absent("Robustness Layers of frontal collisions", 6.0,
            "rated from claims of the manufacturer and their verification"),
        Absent("Lane departure collisions", 20.0, "the public files have no tests of lane support"),
        Absent("Low speed collisions but CPMRCs", 18.5,
            "the public files have no starting from standstill and no dooring"),
    ),
    assumptions=(
        "An overlap O of car-to-car files is read as the impact location 50 % ± (100 − |O|) %; "
        "files for pedestrians and "
        "cyclists state the impact location itself.",
        ("Each run is a verified test point: no prediction of a manufacturer, tolerance or "
        "discount is applied."),
        "Frontal collisions score nothing if a CCRs test up to 20 km/h or a CPNA test at 10 km/h "
        "and 75 % is not green: "
        "the table does not apply this rule.",
        "Files have the light of a day; of several runs of a test point the worst counts.",
        "The files were made for implementation 2023: speeds between the test points of 2026 are "
        "judged where a band exists, "
        "and have no points.",
    ),
)  # fmt: skip
"""The protocol as data"""
