"""The encoder: it learns, reproducibly, in every variant, and is read as it was saved."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys

import numpy as np
import pytest
import torch

from recognition.trfe.encoder.config import PRESETS, Architecture, Preset, TrainingSchedule, preset
from recognition.trfe.encoder.model import Encoder, GridEncoder, augmented
from recognition.trfe.encoder.storage import features, load, logits, save
from recognition.trfe.encoder.training import FrameOrder, deterministic, finetune, pretrain
from recognition.trfe.inputs.grids import Grid
from recognition.trfe.training.windows import Windows
from schemas.common.errors import InvalidFile, UsageError
from studies.recognition.experiments.probe import probe, speed_code
from studies.recognition.protocol.presets import RowTokens

GRID = Grid(24.0, 12.0, 2.0, 1.0, channels=("others", "ego"))
TINY = Architecture(dim=16, depth=1, heads=2, patch=(4, 4, 4))
SHORT = Preset(TINY, TrainingSchedule(1, 32, 1e-3), TrainingSchedule(12, 32, 5e-3))
LEFT, RIGHT, AHEAD = 5, 6, 14


@pytest.fixture(autouse=True, scope="module")
def one_thread():
    """Small networks are as fast with one, and do not wait for each other where
    cores are shared.
    """
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def windows(n: int = 192, seed: int = 0) -> Windows:
    """Egos that move to the left, to the right or straight on, in a rectangle of
    2 × 2 cells, at one speed.
    """
    rng = np.random.default_rng(seed)
    labels = rng.choice([LEFT, RIGHT, AHEAD], n)
    grids = np.zeros((n, *GRID.shape), np.uint8)
    for k, label in enumerate(labels):
        x, y = rng.integers(2, 4), rng.integers(5, 6)
        for frame in range(4):
            dy = {LEFT: -1, RIGHT: 1, AHEAD: 0}[int(label)] * frame
            grids[k, frame, 1, y + dy : y + dy + 2, x + 2 * frame : x + 2 * frame + 2] = 255
    name = np.full(n, "r")
    return Windows(grids, labels.astype(np.int64), name, name, np.zeros(n))


@pytest.fixture(scope="module")
def tuned() -> Encoder:
    return finetune(pretrain(windows(), SHORT, GRID, 1), windows(), SHORT.finetuning, 1)


def test_it_learns_to_tell_left_from_right(tuned):
    unseen = windows(60, seed=9)
    found = np.array(tuned.classes)[logits(tuned, unseen).argmax(axis=1)]
    assert tuned.classes == (LEFT, RIGHT, AHEAD)
    assert (found == unseen.labels).mean() > 0.9


def test_the_same_seed_gives_the_same_weights_and_another_seed_others(tmp_path):
    few, schedule = windows(32), SHORT.finetuning._replace(epochs=2)
    for name, seed in (("one", 3), ("two", 3), ("three", 4)):
        torch.manual_seed(len(name))  # the caller's own randomness plays no part
        save(finetune(pretrain(few, SHORT, GRID, seed), few, schedule, seed), tmp_path / name)
    one, two, three = (
        (tmp_path / name / "encoder.safetensors").read_bytes() for name in ("one", "two", "three")
    )
    assert one == two
    assert one != three


def test_training_leaves_the_given_encoder_and_the_callers_random_numbers_alone():
    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    before = pretrain(windows(32), SHORT, GRID, 0, objectives=())
    weights = {name: value.clone() for name, value in before.state_dict().items()}
    finetune(before, windows(32), SHORT.finetuning._replace(epochs=1), 0)
    assert before.classes == ()
    assert all((value == weights[name]).all() for name, value in before.state_dict().items())
    assert (torch.rand(3) == expected).all()


@pytest.mark.parametrize("kind", [Architecture, RowTokens])
@pytest.mark.parametrize("change", [{"patch": (2, 4, 4)}, {"front": "cnn"}])
def test_every_variant_learns(kind, change):
    architecture = kind(**{**dataclasses.asdict(TINY), **change})
    encoder = pretrain(
        windows(16), SHORT._replace(architecture=architecture), GRID, 0, objectives=()
    )
    trained = finetune(encoder, windows(), SHORT.finetuning, 0)
    found = np.array(trained.classes)[logits(trained, windows(60, seed=2)).argmax(axis=1)]
    assert (found == windows(60, seed=2).labels).mean() > 0.6


def test_tokens_are_patches_of_one_frame_or_runs_of_its_rows():
    grids = torch.zeros((1, *GRID.shape), dtype=torch.uint8)
    grids[0, 2, 1, 5, 6:8] = (
        255  # in rows 4–7 and columns 4–7: the second patch of the second of three rows of patches
    )
    for kind in (Architecture, RowTokens):
        encoder = GridEncoder(kind(**{**dataclasses.asdict(TINY), "patch": (1, 4, 4)}), GRID)
        values = encoder._tokens(grids)
        assert values.shape == (1, 4, 9, 32)
        assert values[0, 2].any(dim=1).nonzero().ravel().tolist() == [4]
        assert not values[0, [0, 1, 3]].any()
        assert values.sum() == pytest.approx(2.0)
    # as runs of sixteen cells, row 5 (of 12 columns) begins in the middle of
    # run 3 and fills run 4 from its fourth cell on
    assert values[0, 2, 4].reshape(2, 16)[1].nonzero().ravel().tolist() == [2, 3]


@pytest.mark.slow
@pytest.mark.parametrize(("objective", "share"), [("order", 0.8), ("barlow", 0.8)])
def test_objectives_of_pretraining_can_be_learnt(objective, share):
    losses: list[float] = []
    short = Preset(
        dataclasses.replace(TINY, dim=32), TrainingSchedule(40, 32, 5e-3), SHORT.finetuning
    )
    pretrain(windows(128), short, GRID, 0, (objective,), lambda _, loss: losses.append(loss))
    assert losses[-1] < share * losses[0]


def test_guessing_the_order_of_frames_is_worth_the_logarithm_of_their_permutations():
    with deterministic(0):
        encoder = GridEncoder(TINY, GRID)
        loss = FrameOrder(encoder)(encoder, torch.from_numpy(windows(64).inputs)).item()
    assert loss == pytest.approx(np.log(24), rel=0.2)


def test_augmentation_keeps_empty_cells_empty_and_moves_by_at_most_a_few():
    grids = torch.from_numpy(windows(40).inputs)
    with deterministic(0):
        changed = augmented(grids)
    assert changed.shape == grids.shape
    assert set((changed[changed > 0].float() / grids.max()).round(decimals=1).tolist()) == {1.0}
    assert not changed[:, :, 0].any()
    rows = [view[:, 0, 1].any(dim=(0, 2)).nonzero().ravel() for view in (grids, changed)]
    assert (rows[0] - rows[1]).abs().max() <= 1
    assert (changed > 0).sum() == pytest.approx(0.9 * (grids > 0).sum().item(), rel=0.1)


def test_features_do_not_depend_on_the_batch(tuned):
    data = windows(300)
    together = features(tuned, data)
    assert together.shape == (300, 16)
    assert together.dtype == np.float32
    assert np.allclose(features(tuned, data.inputs[270:280]), together[270:280], atol=0.05)
    assert (features(tuned, data) == together).all()


def test_features_do_not_depend_on_the_number_of_threads(tuned):
    data, before = windows(300), torch.get_num_threads()
    found = []
    for threads in (1, 2):
        torch.set_num_threads(threads)
        found.append(features(tuned, data))
        assert torch.get_num_threads() == threads
    torch.set_num_threads(before)
    assert (found[0] == found[1]).all()


def test_encoders_are_read_as_they_were_saved(tuned, tmp_path):
    save(tuned, tmp_path)
    read = load(tmp_path)
    assert (read.architecture, read.view, read.classes) == (
        tuned.architecture,
        tuned.view,
        tuned.classes,
    )
    assert (features(read, windows()) == features(tuned, windows())).all()
    save(pretrain(windows(16), SHORT, GRID, 0, ()), tmp_path / "bare")
    assert load(tmp_path / "bare").head is None


@pytest.mark.parametrize(
    "damage",
    [
        "nothing",
        "truncated",
        "foreign",
        "other shape",
        "nan",
        "no json",
        "other json",
        "unknown",
        "pickle",
    ],
)
def test_damaged_encoders_give_one_clear_error(tuned, tmp_path, damage):
    from safetensors.torch import load_file, save_file

    weights, config = tmp_path / "encoder.safetensors", tmp_path / "encoder.json"
    if damage != "nothing":
        save(tuned, tmp_path)
    if damage == "truncated":
        weights.write_bytes(weights.read_bytes()[:-100])
    elif damage == "foreign":
        weights.write_bytes(b"no tensors at all")
    elif damage == "pickle":
        torch.save(tuned.state_dict(), weights)
    elif damage == "other shape":
        save_file(
            {name: value[..., :1].contiguous() for name, value in load_file(weights).items()},
            weights,
        )
    elif damage == "nan":
        save_file(
            {name: value * float("nan") for name, value in load_file(weights).items()}, weights
        )
    elif damage == "no json":
        config.write_text("{")
    elif damage == "other json":
        config.write_text("[1, 2]")
    elif damage == "unknown":
        config.write_text(json.dumps({**json.loads(config.read_text()), "view": {"height": 3}}))
    with pytest.raises(InvalidFile) as error:
        load(tmp_path)
    assert str(tmp_path) in str(error.value)
    assert "\n" not in str(error.value)


def test_wrong_use_is_refused(tuned):
    with pytest.raises(UsageError, match="no preset 'huge'"):
        preset("huge")
    with pytest.raises(UsageError, match="no objective"):
        pretrain(windows(4), SHORT, GRID, 0, ("jigsaw",))
    with pytest.raises(UsageError, match="reads windows of shape"):
        features(tuned, np.zeros((2, 4, 3, 12, 12), np.uint8))
    with pytest.raises(UsageError, match="no class head"):
        logits(GridEncoder(TINY, GRID), windows(4))
    with pytest.raises(UsageError, match="all have labels"):
        finetune(
            tuned,
            dataclasses.replace(windows(4), labels=np.array([0, 1, 2, 3])),
            SHORT.finetuning,
            0,
        )
    with pytest.raises(UsageError, match="there are 1"):
        pretrain(windows(1), SHORT, GRID, 0)


def test_the_presets_have_the_sizes_of_the_method():
    full = PRESETS["full"].architecture
    assert (full.dim, full.patch, full.depth, full.heads) == (512, (1, 20, 20), 8, 4)
    assert PRESETS["cpu"].architecture.dim == 128
    assert 2 <= PRESETS["cpu"].architecture.depth <= 4


def test_the_probe_sees_structure_where_the_speed_tells_nothing(tuned):
    one, other = windows(200, seed=1), windows(200, seed=2)
    assert probe(features(tuned, one), one.labels, features(tuned, other), other.labels) > 0.9
    grid = Grid(
        24.0, 12.0, 2.0, 1.0, channels=("others", "speed")
    )  # here the egos' boxes say 63.75 m/s, all of them
    by_speed = probe(
        speed_code(one.inputs, grid), one.labels, speed_code(other.inputs, grid), other.labels
    )
    assert by_speed == pytest.approx(1 / 3, abs=0.02)
    with pytest.raises(UsageError, match="channel speed"):
        speed_code(one.inputs, GRID)


def test_speeds_are_coded_so_that_a_linear_classifier_tells_ranges_apart():
    grid = Grid(24.0, 12.0, 2.0, 1.0, channels=("speed",))
    speeds = np.random.default_rng(0).uniform(0.0, 40.0, 400)
    grids = np.zeros((400, *grid.shape), np.uint8)
    grids[:, :, 0, 5, 5] = np.rint(speeds / 0.25)[:, None]
    labels = np.where((speeds > 10.0) & (speeds < 20.0), 1, 2)
    codes = speed_code(grids, grid)
    assert probe(codes[:200], labels[:200], codes[200:], labels[200:]) > 0.9


def test_encoders_work_without_torchs_compiler(tuned, tmp_path, monkeypatch):
    """Importing it takes longer than what a command does with a few recordings."""
    for module in ("torch._dynamo", "torch._inductor.config"):
        monkeypatch.setitem(sys.modules, module, None)
    save(tuned, tmp_path)
    assert features(load(tmp_path), windows(8)).shape == (8, TINY.dim)


def test_importing_the_package_does_not_import_torch():
    modules = (
        "recognition.trfe.encoder, recognition.trfe.encoder.config, "
        "recognition.trfe.training.windows"
    )
    code = f"import sys, {modules}; print('torch' in sys.modules)"
    assert (
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        ).stdout.strip()
        == "False"
    )
