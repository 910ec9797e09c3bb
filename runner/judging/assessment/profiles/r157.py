"""UN Regulation 157 (ALKS), Annex 5, section 4, as the public OSC-ALKS-scenarios have it; the
regulation has no points."""

from __future__ import annotations

from runner.judging.assessment.protocol import (
    Absent,
    AssessmentProfile,
    Column,
    CutIn,
    NoContact,
    ProtocolCriterion,
    ProtocolTest,
    Unassessed,
)

SUMMARY = "UN Regulation 157 (ALKS), Annex 5, tests 4.1 to 4.6"

_LANE = (
    "the lane is kept by the scenario's motion unless a system steers, and the files are shorter "
    "than the 5 minutes of the test"
)
_RANGE = "the test rates the range in which a system detects, which is not recorded"
_UNAVOIDABLE = (
    "the collision cannot be avoided by design; the regulation rates the mitigation without a "
    "public limit"
)


def _test(
    number: str, title: str, clause: str, criterion: ProtocolCriterion, remark: str = ""
) -> ProtocolTest:
    files = f"alks_scenario_{number.replace('.', '_')}_"
    return ProtocolTest(number, title, clause, files, criterion, remark=remark)


PROFILE = AssessmentProfile(
    title="UN Regulation 157 (ALKS), Annex 5: tests of the dynamic driving task",
    sources=(
        (
            "UN Regulation No. 157, ECE/TRANS/WP.29/2020/81, paragraphs 5.2.5 and "
            "7.1, Annex 5, section 4"
        ),
        (
            "Scenario files: github.com/asam-oss/OSC-ALKS-scenarios (an interpretation of Annex "
            "5; the regulation states no files)"
        ),
    ),
    columns=(
        Column("test speed (km/h)", ("Ego_InitSpeed_Ve0_kph",)),
        Column("relative speed (km/h)", ("CutInVehicle_RelativeInitSpeed_Ve0_Vo0_kph",)),
        Column(
            "lateral offset (m)",
            ("TargetBlocking_InitPosition_LateralOffset_m", "LeadVehicle_Init_LateralOffset_m"),
        ),
    ),
    tests=(
        _test("4.1_1", "Lane keeping, free driving", "Annex 5, 4.1", Unassessed(_LANE)),
        _test("4.1_2", "Lane keeping, lead vehicle swerves", "Annex 5, 4.1", Unassessed(_LANE)),
        _test("4.1_3", "Lane keeping, vehicle beside", "Annex 5, 4.1", Unassessed(_LANE)),
        _test("4.2_1", "Lane blocked by a vehicle", "Annex 5, 4.2", NoContact()),
        _test(
            "4.2_2",
            "Lane blocked in part",
            "Annex 5, 4.2",
            NoContact(),
            "with an offset beside the ego's path no braking is needed",
        ),
        _test("4.2_3", "Crossing pedestrian", "5.2.5.3", NoContact()),
        _test("4.2_4", "Lane blocked by two vehicles", "Annex 5, 4.2", NoContact()),
        _test(
            "4.3_1",
            "Lead vehicle brakes",
            "5.2.5.1",
            NoContact(),
            "harshness and following distance are not rated",
        ),
        _test("4.3_2", "Lead vehicle brakes hard", "5.2.5.1", NoContact()),
        _test(
            "4.4_1",
            "Cut-in",
            "5.2.5.2",
            CutIn(),
            "the cutting-in vehicle is taken as visible for 0.72 s before the intrusion",
        ),
        _test("4.4_2", "Cut-in, unavoidable", "5.2.5.2", Unassessed(_UNAVOIDABLE)),
        _test(
            "4.5_1",
            "Cut-out before a blocked lane",
            "Annex 5, 4.5",
            NoContact(),
            "an unavoidable set counts, too",
        ),
        _test(
            "4.5_2",
            "Cut-out before two vehicles",
            "Annex 5, 4.5",
            NoContact(),
            "an unavoidable set counts, too",
        ),
        _test("4.6_1", "Forward detection range", "7.1.1", Unassessed(_RANGE)),
        _test("4.6_2", "Lateral detection range", "7.1.2", Unassessed(_RANGE)),
    ),
    absent=(
        Absent(
            "Transition demand, minimum risk manoeuvre, emergency manoeuvre",
            0.0,
            "the public files have no such tests",
        ),
        Absent(
            "Human-machine interface, data storage, cyber security", 0.0, "these are not simulated"
        ),
    ),
    assumptions=(
        "Paragraphs 5.2.5.1 to 5.2.5.3, 7.1.1 and 7.1.2 were compared with public quotations of "
        "the regulation; the numbers of "
        "Annex 5 are those in the names of the public files.",
        (
            "A run is one parameter set of the files; the regulation leaves the sets to the "
            "technical service."
        ),
        (
            "The comparison with a competent and careful driver (Annex 4, Appendix 3) is a batch "
            "of its own: --sut r157-cc."
        ),
    ),
)
"""The regulation as data"""
