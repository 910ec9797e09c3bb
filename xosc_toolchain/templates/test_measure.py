"""Time exposed to a short time to collision."""

import pytest

import xosc_toolchain as xt


def test_it_is_measured_in_a_run_and_is_a_limit() -> None:
    result = xt.run("simple_cut_in", sut="none", world="kinematic", fail_if=("acme_tet>0.2",))
    assert result.criticality is not None
    series = result.criticality.ttc
    short = int((series.value[series.valid] < 1.5).sum())
    assert short > 0
    assert result.criticality.summary["acme_tet"] == pytest.approx(0.05 * short)
    assert any("acme_tet" in reason for reason in result.verdict.reasons)
