"""Verdicts of xosc-check on the public test files of ASAM's checkers: their names say which rule
they break or keep.

    python -m benchmarks.qc_checkers qc-opendrive/tests/data
    python -m benchmarks.qc_checkers qc-openscenarioxml/tests/data

A folder is named after a rule, a file in it after its verdict: `…invalid…`, `…negative…` and
`…_issue` break the rule; `…valid…` and `…positive…` keep it; `…older_schema…`, `…skipped` and
`…_v10` are of versions that the rule does not concern. Other folders have no verdict.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import schemas
from schemas.checks.registry import all_rules

RULES = {
    "junction_connection_linkage": ("start_along_linkage", "end_opposite_linkage"),
    "road_geometry_param_poly3_length_match": ("parampoly3.length_match",),
    "road_geometry_parampoly3_valid_parameters": ("paramPoly3.valid_parameters",),
    "transition_time_should_be_non_negative": (
        "non_negative_transition_time_in_light_state_action",
    ),
    "smoothness_example": ("contact_point_no_horizontal_gaps",),
    "road_lane_level_true_one_side_junction": ("level_true_one_side",),
    "road_lane_level_true_one_side_lanesection": ("level_true_one_side",),
    "road_lane_level_true_one_side_road": ("level_true_one_side",),
}
"""Ends of rules' uids by folder, where the folder's name is not that of the rule."""
WITHOUT_VERDICT = (
    "examples", "not_implemented_yet", "utils", "non_existing_road_network_file",
    "parameter_declaration_with_expression", "parametric_entity_ref", "parametric_input_xodr",
    "parametric_operator_in_expression",
)  # fmt: skip


def main() -> None:
    """Print each verdict that differs, and how many are equal."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument(
        "folder", type=Path, help="tests/data of qc-opendrive or qc-openscenarioxml"
    )
    folder = parser.parse_args().folder
    equal = total = 0
    for path in sorted(folder.glob("*/*.xo[ds][rc]")):
        if (
            path.parent.name in WITHOUT_VERDICT or path.name == "test.xodr"
        ):  # a road that scenarios of the folder refer to
            continue
        broken, found = expected(path), breaks(path)
        total += 1
        equal += broken == found
        if broken != found:
            print(
                f"{path.relative_to(folder)}: expected {'a problem' if broken else 'none'}, found "
                f"{'one' if found else 'none'}"
            )
    print(f"{equal} of {total} verdicts are equal ({100 * equal / max(total, 1):.1f} %)")


def expected(path: Path) -> bool:
    """Whether a file breaks the rule of its folder, by its name."""
    name = path.stem
    skipped = "older_schema" in name or name.endswith(("skipped", "_v10"))
    return not skipped and ("invalid" in name or "negative" in name or name.endswith("issue"))


def breaks(path: Path) -> bool:
    """Whether xosc-check finds a problem of the rule of the file's folder."""
    name = path.parent.name
    ends = RULES.get(name, (name,))
    uids = {
        rule.uid
        for rule in all_rules()
        if rule.uid.replace(".", "_").endswith(tuple(end.replace(".", "_") for end in ends))
    }
    if not uids:
        raise SystemExit(f"no rule is named like the folder {name}")
    return any(
        problem.rule in uids and "not validated" not in problem.message
        for problem in schemas.check(path)
    )


if __name__ == "__main__":
    main()
