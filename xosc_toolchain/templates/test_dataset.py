"""Logs: a car on a diagonal, and a file with a word in the place of a number."""

import math
from pathlib import Path

import numpy as np
import pytest

import xosc_toolchain as xt
from recognition import recordings

HEAD = "t,name,x,y,yaw\n"


def test_speeds_follow_from_the_places(tmp_path: Path) -> None:
    rows = [f"{k / 10:.1f},me,{k:.1f},{k:.1f},45\n" for k in range(30)]
    (tmp_path / "acme_yard.csv").write_text(HEAD + "".join(rows))
    (source,) = recordings.open(tmp_path).sources
    recording = source.load()
    assert (source.site, source.format) == ("yard", "acme log")
    assert np.allclose(recording.tracks["me"].columns["speed"], 10.0 * math.sqrt(2.0))


def test_a_word_is_no_number(tmp_path: Path) -> None:
    (tmp_path / "acme_yard.csv").write_text(HEAD + "0.0,me,here,0.0,45\n")
    with pytest.raises(xt.ToolchainError, match=r"acme_yard.csv:2: column x: 'here'"):
        recordings.open(tmp_path).sources[0].load()
