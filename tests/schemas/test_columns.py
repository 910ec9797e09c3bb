"""Numbers of a document in many parameter sets at once."""

import math
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

import xosc
from schemas.expressions.columns import Columns, NotInArrays, NumberColumn, reading
from xosc.document.node import Node
from xosc.resolve.parameters import Assignment, ParameterScope

SCENARIO = Path(__file__).parents[2] / "xosc" / "library" / "cut_in_highway.xosc"


def column(*values: float) -> NumberColumn:
    return np.array(values).view(NumberColumn)


def test_a_decision_is_that_of_the_first_set_and_others_are_not_alike() -> None:
    with reading(Columns(3)) as columns:
        assert min(column(1.0, 2.0, 5.0), 3.0)[0] == 1.0
    assert columns.alike.tolist() == [True, True, False]


def test_an_integer_is_that_of_the_first_set() -> None:
    with reading(Columns(3)) as columns:
        assert int(column(2.0, 2.0, 1.0)) == 2
    assert columns.alike.tolist() == [True, True, False]


def test_functions_of_single_numbers_refuse_a_column() -> None:
    with reading(Columns(2)), pytest.raises(NotInArrays):
        math.cos(column(1.0, 2.0))


def test_outside_a_reading_a_column_has_no_truth_value() -> None:
    with pytest.raises(ValueError, match="while a document is read"):
        bool(column(1.0, 2.0) > 1.5)


def test_attributes_and_expressions_are_columns_where_they_vary() -> None:
    document = xosc.load(SCENARIO)
    speeds = column(20.0, 30.0, 36.5)
    with reading(Columns(3)) as columns:
        resolved = xosc.resolve(document, {"CutIn_Gap_m": 12}, columns={"Ego_Speed_mps": speeds})
        start = resolved.node.need("Storyboard", "Init")
        ego, other = (next(start.iter(tag)) for tag in ("LanePosition", "RelativeLanePosition"))
        asked = [each.finite("value") for each in start.iter("AbsoluteTargetSpeed")]
        s, ds = ego.finite("s"), other.finite("ds")
    assert np.array_equal(asked[0], speeds) and asked[1] == 25.5
    singly = [
        xosc.resolve(document, {"CutIn_Gap_m": 12, "Ego_Speed_mps": float(each)}) for each in speeds
    ]
    for tag, name, values in (("LanePosition", "s", s), ("RelativeLanePosition", "ds", ds)):
        truth = [next(each.node.iter(tag)).finite(name) for each in singly]
        assert values.tolist() == truth
    assert columns.alike.all()


def test_expressions_vary_inside_an_element_that_declares_nothing_itself() -> None:
    outer = [Node(etree.XML('<P name="Speed" parameterType="double" value="20"/>'), SCENARIO)]
    with reading(Columns(2)) as columns:
        assigned = {
            "Speed": Assignment("20", outer[0].invalid, symbolic=False, column=column(20.0, 30.0))
        }
        inner = ParameterScope((), ParameterScope(outer, None, assigned))
        assert columns.of(inner.literal("${$Speed / 2}")).tolist() == [10.0, 15.0]
