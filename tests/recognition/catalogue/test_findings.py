"""How labelled moments become findings, and what a model makes of moments."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from safetensors import numpy as safetensors

from recognition import recordings as datasets
from recognition.catalogue.detect import DISCOVERED, KNOWN, RULES, UNKNOWN, Moment, joined
from recognition.catalogue.model import ByModel, objection, title_of, unseen_sites
from recognition.labels import Label, LabelledEvent
from recognition.scenes import place, site_at
from recognition.trfe.config import Config
from recognition.trfe.discovery.candidates import Buffer
from recognition.trfe.encoder.config import Architecture
from recognition.trfe.encoder.model import GridEncoder
from recognition.trfe.forest.known import FIRST_DISCOVERED
from recognition.trfe.inputs.grids import Grid
from recognition.trfe.storage import load
from recognition.trfe.trfe import TRFE
from runner.recording import Recording
from schemas.common.errors import InvalidFile, UsageError
from tests.recognition import motorway
from tests.recognition.clouds import clouds
from tests.recognition.driving import track


def moment(time: float, title: str = "a", ego: str = "1", **other: object) -> Moment:
    return Moment(ego, time, title, KNOWN, **other)


def test_close_moments_of_one_class_are_one_finding() -> None:
    (one, two) = joined([moment(3.0), moment(1.0), moment(2.0), moment(9.0)], gap=1.0)
    assert (one.start, one.end, one.moments, one.moment.time) == (0.25, 3.75, 3, 1.0)
    assert (two.start, two.end, two.moments) == (8.25, 9.75, 1)


def test_other_egos_classes_and_partners_are_other_findings() -> None:
    cut = {"rule": Label.CUT_IN}
    others = [
        moment(1.0),
        moment(1.0, ego="2"),
        moment(1.0, "b"),
        moment(1.2, "c", partner="5", **cut),
        moment(1.2, "c", partner="6", **cut),
    ]
    assert len(joined(others, gap=1.0)) == 5


def test_the_moment_of_a_rule_stands_for_a_finding_then_the_surest() -> None:
    sure, rule = (
        moment(2.0, confidence=0.9),
        moment(3.0, confidence=0.1, rule=Label.CUT_IN, partner="5"),
    )
    assert joined([moment(1.0, confidence=0.2), sure], gap=1.0)[0].moment is sure
    (finding,) = joined([moment(1.0, confidence=0.2), sure, rule, moment(4.0)], gap=1.0)
    assert finding.moment is rule


def test_names_of_classes() -> None:
    assert [title_of(label) for label in (0, 3, FIRST_DISCOVERED, FIRST_DISCOVERED + 11)] == [
        "unknown", "highway cut in", "discovered 01", "discovered 12"
    ]  # fmt: skip


PARKED = track("parked", np.full(100, 50.0), 0.0, heading=0.0)


class Oracle:
    """Stands in for TRFE: windows about `cut` are cut-ins, other windows of egos
    3 and 4 unknown, the rest free cruise.
    """

    def __init__(self, promotes: bool = True, capacity: int = 20) -> None:
        self.encoders = (
            SimpleNamespace(view=Grid(channels=("others", "ego"), length=40.0, width=10.0)),
        )
        self.config = SimpleNamespace(preprocessing=SimpleNamespace(neighbours=3))
        self.buffer = Buffer(capacity)
        self.promotes, self.seen, self.rounds = promotes, 0, 0

    def encode(self, grids: np.ndarray) -> np.ndarray:
        return grids

    def observe(self, grids: np.ndarray, keys: np.ndarray) -> SimpleNamespace:
        assert grids.shape[1:] == self.encoders[0].view.shape
        labels = np.where(keys % 2 == 0, int(Label.FREE_CRUISE), int(Label.UNKNOWN))
        unknown = labels == Label.UNKNOWN
        self.buffer.add(np.zeros((int(unknown.sum()), 4), np.float32), keys[unknown])
        self.seen += len(keys)
        return SimpleNamespace(
            labels=labels,
            closed=np.full(len(keys), int(Label.CUT_IN)),
            confidence=np.full(len(keys), 0.5),
        )

    def discover(self) -> SimpleNamespace:
        self.rounds += 1
        labels = np.where(
            np.arange(len(self.buffer)) % 2 == 0, FIRST_DISCOVERED if self.promotes else 0, 0
        )
        return SimpleNamespace(keys=self.buffer.keys, labels=labels)

    def expand(self, found: SimpleNamespace) -> None:
        self.buffer.remove(found.labels > 0)


def look(folder: Path, oracle: Oracle, *, sorts: bool = True, **options: bool) -> ByModel:
    """A motorway seen through an oracle, with a vehicle parked on it."""
    (source,) = datasets.open(motorway.write_motorway(folder), roads=folder).sources
    recording = source.load()
    assert recording.network is not None
    recording = Recording(
        [*recording.tracks.values(), PARKED], recording.timestep, recording.network
    )
    place(recording, recording.network)
    events = [
        LabelledEvent("01", motorway.EGO, 6.0, Label.CUT_IN, motorway.CUTTER, {"gap": 40.0}),
        LabelledEvent("01", "1", 0.1, Label.CUT_OUT, None, {}),
    ]
    recogniser = ByModel(oracle, sorts=sorts, stride=1.0, **options)
    shares: list[float] = []
    recogniser.look("01", recording, site_at(Path(recording.network.path)), events, shares.append)
    assert sum(shares) == pytest.approx(1.0)
    return recogniser


@pytest.fixture(scope="module")
def looked(tmp_path_factory: pytest.TempPathFactory) -> tuple[Oracle, ByModel]:
    oracle = Oracle()
    return oracle, look(tmp_path_factory.mktemp("motorway"), oracle, discover=True)


def test_a_model_sees_events_and_a_regular_stride(looked: tuple[Oracle, ByModel]) -> None:
    moments = looked[1].moments("01")
    (event,) = [each for each in moments if each.rule]
    assert (event.time, event.rule, event.partner, event.tags) == (
        6.0,
        Label.CUT_IN,
        motorway.CUTTER,
        {"gap": 40.0},
    )
    own = sorted(each.time for each in moments if each.ego == motorway.EGO)
    assert np.diff(own).min() >= 0.5 and np.diff(own).max() <= 1.5
    assert own[0] >= 0.75 and own[-1] <= 11.96 - 0.75
    assert {each.ego for each in moments} == {"1", "2", "3", "4", "5", "6", "7"}


def test_the_model_decides_and_unknown_ones_are_discovered(looked: tuple[Oracle, ByModel]) -> None:
    oracle, recogniser = looked
    moments = recogniser.moments("01")
    assert oracle.seen == len(moments) and oracle.rounds >= 2
    states = {each.state: each.title for each in moments}
    assert states == {KNOWN: "highway free cruise", UNKNOWN: "unknown", DISCOVERED: "discovered 01"}
    assert all(each.model == each.title for each in moments)
    assert {(each.nearest, each.confidence) for each in moments} == {("highway cut in", 0.5)}
    assert recogniser.moments("01") == moments, "asking again changes nothing"


def test_rules_sort_their_events_and_leave_the_rest_to_the_model_where_it_is_unknown(
    tmp_path: Path,
) -> None:
    recogniser = look(tmp_path, Oracle(), sorts=False, discover=True)
    moments = recogniser.moments("01")
    (event,) = [each for each in moments if each.rule]
    assert (event.title, event.state, event.model, event.labels_agree) == (
        "highway cut in",
        KNOWN,
        "highway free cruise",
        False,
    )
    rest = [each for each in moments if not each.rule]
    assert {each.state for each in rest} == {UNKNOWN, DISCOVERED} and {
        each.labels_agree for each in rest
    } == {None}
    assert recogniser.sorted_by == RULES
    assert event.trust == "differ" and {each.trust for each in rest} == {"model alone"}


@pytest.mark.parametrize("sorts", [True, False])
def test_unknown_and_discovered_moments_are_given_on_request_only(
    tmp_path: Path, sorts: bool
) -> None:
    moments = look(tmp_path, Oracle(), sorts=sorts).moments("01")
    assert {each.state for each in moments} <= {KNOWN}
    assert [each.rule for each in moments if each.rule] == [Label.CUT_IN]


def stating(folder: Path, unseen: object) -> Path:
    """A model's folder with what it states of sites not seen."""
    about = {"about": json.dumps({"unseen_sites": unseen} if unseen is not None else {})}
    (folder / "model.safetensors").write_bytes(safetensors.save({"a": np.zeros(1)}, about))
    return folder


@pytest.mark.parametrize(
    ("unseen", "why"),
    [
        (None, "does not state"),
        (
            {"agree": 0.74, "wrong": 0.1},
            "74% get their class from the model and 10% another one or none",
        ),
        (
            {"agree": 0.8, "wrong": 0.11},
            "80% get their class from the model and 11% another one or none",
        ),
        ({"agree": 0.75, "wrong": 0.1}, None),
    ],
)
def test_a_model_sorts_where_it_states_good_figures_for_sites_not_seen(
    tmp_path: Path, unseen: object, why: str | None
) -> None:
    found = objection(unseen_sites(stating(tmp_path, unseen)))
    assert found is why if why is None else why in str(found)


@pytest.mark.parametrize(
    "unseen", [{"agree": 0.8}, 3, {"agree": "x", "wrong": 0}, {"agree": 1.2, "wrong": 0}]
)
def test_figures_that_are_no_shares_are_refused(tmp_path: Path, unseen: object) -> None:
    with pytest.raises(InvalidFile, match="unseen_sites"):
        unseen_sites(stating(tmp_path, unseen))


def test_what_waits_in_a_model_from_before_is_taken_for_none_of_the_moments(tmp_path: Path) -> None:
    oracle = Oracle(capacity=10_000)
    oracle.buffer.add(np.zeros((6, 4), np.float32), np.arange(6))
    moments = look(tmp_path, oracle, discover=True).moments("01")
    assert [each.state == KNOWN for each in moments] == [
        number % 2 == 0 for number in range(6, 6 + len(moments))
    ]
    assert DISCOVERED in {each.state for each in moments}


@pytest.mark.slow
def test_a_model_that_is_kept_knows_what_it_discovered(tmp_path: Path) -> None:
    encoder = GridEncoder(
        Architecture(8, 1, 2, (4, 8, 8)), Grid(channels=("others", "ego"), length=40.0, width=10.0)
    ).eval()
    trfe = TRFE(Config(trees=20, delta=0.5), (encoder,))
    samples = [clouds([1, 2, 9], 60, seed=seed, width=8, apart=20.0) for seed in range(3)]
    known = [(features[truth < 9], truth[truth < 9]) for features, truth in samples]
    trfe.fit(*known[0], *known[1])
    new = samples[2][0][samples[2][1] == 9]
    trfe.observe(new, np.arange(len(new)))
    trfe.expand(trfe.discover())
    trfe.buffer.add(100.0 * new[:3], np.arange(3))
    for waiting, left in ((True, 3), (False, 0)):
        ByModel(trfe, sorts=True).keep(tmp_path / "kept", waiting=waiting)
        kept = load(tmp_path / "kept")
        assert set(kept.recognise(new).labels.tolist()) & {FIRST_DISCOVERED}
        assert len(kept.buffer) == left


def test_a_model_without_an_encoder_is_refused() -> None:
    with pytest.raises(UsageError, match="no encoder"):
        ByModel(SimpleNamespace(encoders=()), sorts=True)
