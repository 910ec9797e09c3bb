"""Tokens: who is where in lane coordinates, whatever the place and shape of the
road; and the encoder that reads them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from recognition.labels import Rules
from recognition.scenes import Site
from recognition.trfe.encoder.config import TokenArchitecture
from recognition.trfe.encoder.model import TokenEncoder
from recognition.trfe.inputs.samples import BACKGROUND
from recognition.trfe.inputs.tokens import FEATURES, SCALES, Tokens, relations, tokenise
from recognition.trfe.training.windows import events_and_background, visible
from runner.recording import Recording
from schemas.common.errors import UsageError
from tests.recognition.driving import STEP, ahead, site, track
from xodr.builders import four_way_intersection, straight_highway

TOKENS = Tokens(others=3)
WIDTH = 3.75


@pytest.fixture(scope="module")
def highway(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return site(straight_highway(lanes=3, length=600.0), tmp_path_factory.mktemp("highway"))


def in_lane(lane: int) -> float:
    return -(lane - 0.5) * WIDTH


@pytest.fixture
def traffic() -> Recording:
    """An ego in the middle lane, its lead, one to the left, and one that comes late."""
    tracks = [
        track("ego", ahead(50.0, 20.0, 8.0), in_lane(2)),
        track("lead", ahead(90.0, 20.0, 8.0), in_lane(2)),
        track("left", ahead(60.0, 22.0, 8.0), in_lane(1)),
        track("late", ahead(200.0, 20.0, 3.0), in_lane(3), start=5.0),
    ]
    return Recording(tracks, STEP, None)


def value(window: np.ndarray, who: int, name: str) -> np.ndarray:
    return window[who, :, FEATURES.index(name)].astype(float) * SCALES.get(name, 1.0)


def test_participants_are_where_they_are_along_the_lanes(highway: Site, traffic: Recording) -> None:
    [window] = tokenise(traffic, [("ego", 4.0)], TOKENS, highway)
    assert window.shape == TOKENS.shape
    assert value(window, 0, "speed") == pytest.approx(20.0, abs=0.1)
    assert value(window, 1, "is_lead").tolist() == [1.0] * TOKENS.frames
    assert value(window, 1, "along") == pytest.approx(40.0, abs=0.1)
    assert value(window, 1, "lanes_left").tolist() == [0.0] * TOKENS.frames
    assert value(window, 2, "lanes_left").tolist() == [1.0] * TOKENS.frames
    assert value(window, 2, "aside") == pytest.approx(WIDTH, abs=0.05)
    assert value(window, 2, "closing_ahead") == pytest.approx(2.0, abs=0.05)
    assert value(window, 0, "gap") == pytest.approx(40.0 - 4.5, abs=0.1)
    assert value(window, 0, "lanes_to_left") == pytest.approx(1.0) and value(
        window, 0, "lanes_to_right"
    ) == pytest.approx(1.0)
    assert value(window, 0, "role_main").tolist() == [1.0] * TOKENS.frames


def test_who_is_not_there_is_not_a_number(highway: Site, traffic: Recording) -> None:
    [window] = tokenise(traffic, [("ego", 4.0)], TOKENS, highway)
    late = np.isnan(window[3]).all(axis=1)
    assert late.tolist() == [offset + 4.0 < 5.0 - 0.5 * STEP for offset in TOKENS.offsets]
    [early] = tokenise(traffic, [("ego", 1.0)], TOKENS, highway)
    assert np.isnan(early[0]).all(axis=1).tolist() == [
        offset + 1.0 < -0.5 * STEP for offset in TOKENS.offsets
    ]
    assert visible(traffic, [("ego", 1.0), ("ego", 0.2), ("late", 9.0)], TOKENS).tolist() == [
        True,
        False,
        False,
    ]


def test_unknown_egos_are_refused(highway: Site, traffic: Recording) -> None:
    with pytest.raises(UsageError, match="no vehicle 'nobody'"):
        tokenise(traffic, [("nobody", 1.0)], TOKENS, highway)


def test_ways_to_one_lane_merge_and_oncoming_lanes_are_unrelated(tmp_path: Path) -> None:
    graph = site(four_way_intersection(), tmp_path).lanes
    target = next(number for number, before in enumerate(graph.preceding) if len(before) == 3)
    one, other = (graph.preceding[number][0] for number in graph.preceding[target][:2])
    oncoming = next(
        number
        for number, strip in enumerate(graph.strips)
        if strip.road == graph.strips[one].road and number != one
    )
    found = relations(
        graph, np.array([one, one, one, target]), np.array([target, other, oncoming, one])
    )
    assert found.same_way.tolist() == [True, False, False, True]
    assert found.merging.tolist() == [False, True, False, False]
    assert found.base[0] == -found.base[3] > 0.0
    assert found.lanes.tolist() == [0, 0, 0, 0]


def test_background_is_where_no_rule_finds_anything(highway: Site) -> None:
    way = np.concatenate(
        [
            ahead(20.0, 20.0, 8.0),
            180.0 + np.cumsum(20.0 * STEP + 0.5 * STEP * np.sin(np.arange(80) * STEP) * 4.0),
        ]
    )
    recording = Recording([track("ego", way, in_lane(2))], STEP, None)
    events, regular = events_and_background(recording, highway, "r", Rules())
    lasting = {moment.time for moment in regular if moment.label != BACKGROUND}
    assert {event.label.name for event in events} == {"FREE_CRUISE"}
    assert len(lasting) >= len(events) and max(lasting) < 9.0
    assert any(moment.label == BACKGROUND for moment in regular if moment.time > 10.0)


def windows(count: int = 5) -> torch.Tensor:
    made = torch.from_numpy(
        np.random.default_rng(0).normal(size=(count, *TOKENS.shape)).astype(np.float16)
    )
    made[:, 3] = torch.nan
    return made


def test_the_encoder_sees_neither_the_order_of_others_nor_who_is_absent() -> None:
    torch.manual_seed(0)
    encoder = TokenEncoder(TokenArchitecture(dim=16, depth=2, heads=2), TOKENS).eval()
    given = windows()
    with torch.inference_mode():
        found = encoder(given)
        assert torch.allclose(encoder(given[:, [0, 2, 3, 1]]), found, atol=1e-5)
        fewer = TokenEncoder(encoder.architecture, Tokens(others=2)).eval()
        fewer.load_state_dict(encoder.state_dict())
        assert torch.allclose(fewer(given[:, :3]), found, atol=1e-5)
        assert not torch.allclose(encoder(given[:, [1, 0, 2, 3]]), found, atol=1e-2)


def test_augmentation_keeps_the_ego_and_the_shape() -> None:
    encoder = TokenEncoder(TokenArchitecture(dim=16, depth=1, heads=2), TOKENS)
    torch.manual_seed(0)
    changed = encoder.augmented(windows(200))
    assert changed.shape == (200, *TOKENS.shape)
    there = ~changed[..., 0].isnan()
    assert there[:, 0].any(dim=1).all() and not there[:, 3].any()
    assert 0.03 < 1.0 - there[:, 1].any(dim=1).float().mean() < 0.2


@pytest.mark.parametrize(
    "values", [{"core": 0.0}, {"core": 9.0}, {"frames": 1}, {"others": -1}, {"reach": 0.0}]
)
def test_windows_that_make_no_sense_are_refused(values: dict[str, float]) -> None:
    with pytest.raises(UsageError):
        Tokens(**values)  # type: ignore[arg-type]


def test_patches_have_to_fit_the_frames() -> None:
    with pytest.raises(UsageError, match="do not fit"):
        TokenEncoder(TokenArchitecture(patch=5), TOKENS)
