"""TRFE models in a folder: `model.safetensors` (settings, samples, screening, prototypes),
`forest.safetensors` (`recognition.trfe.forest.trees.Trees`), the encoder's files.

No file is trusted: reading runs no code of it, settings must be of the types of `Config`, arrays
finite and of fitting shapes, and trees sound, whose paths end at leaves.
"""

from __future__ import annotations

import json
from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from recognition.trfe.config import Config, Steps
from recognition.trfe.encoder.inference import StoredEncoder
from recognition.trfe.forest import Neighbours, VotingForest
from recognition.trfe.forest.known import KnownClasses, Labelled, labelled
from recognition.trfe.forest.screening import EvtJoint
from recognition.trfe.forest.trees import Trees
from recognition.trfe.inputs.samples import Prototypes, matrix
from recognition.trfe.inputs.tokens import CHANGES, Tokens
from recognition.trfe.trfe import TRFE
from schemas.common.errors import InvalidFile, ToolchainError, UsageError, reason
from schemas.common.policy import current
from schemas.common.storage import keep, writing

if TYPE_CHECKING:
    from recognition.trfe.encoder.model import Encoder

Arrays = dict[str, NDArray[Any]]
_MODEL, _FOREST, _ENCODER = "model.safetensors", "forest.safetensors", "encoder"
_FORMAT = "xosc-toolchain TRFE 5"
_ABOUT = "about"
"""The only metadata key: safetensors writes several in an order that varies"""


def save(model: TRFE, folder: Path, samples: int | None = None) -> None:
    """Write a fitted model.

    Args:
        model: the model.
        folder: is made where it is absent.
        samples: most labelled samples of each class to write, of those to fit and of those to
            calibrate, in half precision; None writes all as they are. They matter where the model
            goes on to discover classes.

    Raises:
        UsageError: the model has not been fitted, has steps of a study, or the folder can't be
            written.
    """
    from safetensors import numpy as safetensors

    known = model.known
    if model.steps != Steps():
        raise UsageError("only models with the method's own steps can be stored")
    arrays = {
        **_prefixed("fitted", _thinned(known.fitted, samples)._asdict()),
        **_prefixed("calibrating", _thinned(known.calibrating, samples)._asdict()),
        **_prefixed(
            "neighbours", known.forest.neighbours._asdict() if known.forest.neighbours else {}
        ),
        **_prefixed("prototypes", vars(known.prototypes)),
        **_prefixed("screening", known.screening.state()),
    }
    if model.buffer.inputs is not None:
        arrays |= _prefixed("buffer", {"inputs": model.buffer.inputs, "keys": model.buffer.keys})
    if model.least:
        arrays |= _prefixed(
            "least",
            {"classes": np.array([*model.least]), "shares": np.array([*model.least.values()])},
        )
    stated = (
        {"unseen_sites": dict(zip(("agree", "wrong"), model.unseen_sites, strict=True))}
        if model.unseen_sites
        else {}
    )
    about = {_ABOUT: json.dumps({"format": _FORMAT, "config": asdict(model.config), **stated})}
    # safetensors writes memory as it lies: arrays of another order would be scrambled.
    with writing("the model", folder):
        keep(
            safetensors.save(
                {name: np.asarray(value, order="C") for name, value in arrays.items()}, about
            ),
            folder / _MODEL,
        )
        keep(safetensors.save(known.forest.trees.arrays()), folder / _FOREST)
        for number, encoder in enumerate(model.encoders):
            place = folder / f"{_ENCODER}{number}"
            if isinstance(encoder, StoredEncoder):
                encoder.save(place)
                continue
            from recognition.trfe.encoder import storage

            storage.save(encoder, place)


def load(folder: Path) -> TRFE:
    """Read what `save` wrote.

    Raises:
        InvalidFile: a file is missing, truncated, not such a model's, or not to be trusted.
    """
    config, unseen, arrays = _read_model(folder / _MODEL)
    forest = _read_forest(folder / _FOREST)
    encoders = _read_encoders(folder)
    try:
        model = TRFE(config, encoders, _known(config, arrays, forest))
        model.unseen_sites = unseen
        model.least = _least(_part(arrays, "least"))
        width = model.known.fitted.features.shape[1]
        encoded = sum(encoder.architecture.dim for encoder in encoders)
        if encoders and config.changes not in (
            0,
            CHANGES if isinstance(encoders[0].view, Tokens) else 0,
        ):
            raise ValueError(f"{config.changes} features can't be of what changes in a window")
        if encoders and config.changes + encoded != width:
            raise ValueError(f"its encoders give {encoded} features, not {width - config.changes}")
        waiting = _part(arrays, "buffer")
        if waiting:
            model.buffer.add(matrix(waiting["inputs"], width), waiting["keys"])
        # Parts that do not fit fail here, not in the middle of a catalogue.
        model.recognise(model.known.fitted.features[:1])
    except (KeyError, ValueError, IndexError, TypeError, ToolchainError) as error:
        raise InvalidFile(
            f"its parts do not fit together: {reason(error)}", path=folder / _MODEL
        ) from None
    return model


def _least(arrays: Arrays) -> dict[int, float]:
    if not arrays:
        return {}
    if not ((arrays["shares"] >= 0.0) & (arrays["shares"] <= 1.0)).all():
        raise ValueError("least shares of votes are from 0 to 1")
    return dict(zip(arrays["classes"].tolist(), arrays["shares"].tolist(), strict=True))


def _read_encoders(folder: Path) -> list[Encoder | StoredEncoder]:
    """Encoders of tokens as they are stored; those of grids are torch's."""
    return [
        StoredEncoder.read(place) or _torch_encoder(place)
        for place in sorted(folder.glob(f"{_ENCODER}[0-9]"))
    ]


def _torch_encoder(place: Path) -> Encoder:
    from recognition.trfe.encoder import storage

    return storage.load(place)


def _thinned(samples: Labelled, most: int | None) -> Labelled:
    """The first samples of each class, in their order and in half precision; all as they are
    without a number."""
    if most is None:
        return samples
    chosen = [np.flatnonzero(samples.labels == label)[:most] for label in np.unique(samples.labels)]
    rows = np.sort(np.concatenate(chosen))
    return Labelled(samples.features[rows].astype(np.float16), samples.labels[rows])


def _prefixed(prefix: str, arrays: Arrays) -> Arrays:
    return {f"{prefix}.{name}": value for name, value in arrays.items()}


def _part(arrays: Arrays, prefix: str) -> Arrays:
    return {
        name.removeprefix(f"{prefix}."): value
        for name, value in arrays.items()
        if name.startswith(f"{prefix}.")
    }


def _known(config: Config, arrays: Arrays, forest: Trees) -> KnownClasses:
    fitted, calibrating = (labelled(**_part(arrays, name)) for name in ("fitted", "calibrating"))
    prototypes = Prototypes(**_part(arrays, "prototypes"))
    screening = EvtJoint(seed=config.seed).restore(_part(arrays, "screening"))
    voting = VotingForest(forest, Neighbours(**_part(arrays, "neighbours")))
    classes = voting.classes
    for of in (fitted.labels, calibrating.labels, prototypes.classes, screening.classes):
        if not np.array_equal(np.unique(of), classes):
            raise ValueError("they are of different classes")
    width, seen = fitted.features.shape[1], config.recognising(fitted.features).shape[1]
    if not (
        width == calibrating.features.shape[1]
        and seen == prototypes.centres.shape[1] == len(prototypes.mean)
    ):
        raise ValueError("they are of different dimensions")
    return KnownClasses(fitted, calibrating, voting, screening, prototypes)


def _read_model(path: Path) -> tuple[Config, tuple[float, float] | None, Arrays]:
    from safetensors import SafetensorError, safe_open

    current().admit(path)
    try:
        with safe_open(path, "numpy") as file:
            about = json.loads((file.metadata() or {})[_ABOUT])
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        if about["format"] != _FORMAT:
            raise ValueError(f"its format is {about['format']!r}, {_FORMAT!r} is expected")
        config, stated = _settings(Config, about["config"]), about.get("unseen_sites")
        unseen = (float(stated["agree"]), float(stated["wrong"])) if stated is not None else None
    except (OSError, SafetensorError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise InvalidFile(f"this is no model: {reason(error)}", path=path) from None
    for name, value in arrays.items():
        if not np.issubdtype(value.dtype, np.number) or not np.isfinite(value).all():
            raise InvalidFile(f"{name} is not made of finite numbers", path=path)
    return config, unseen, arrays


_LARGEST = 1e9
"""Largest number that a setting has: seeds and counts are below it"""


def _settings(kind: type, values: dict[str, Any]) -> Any:
    """A dataclass of settings from JSON, each of the type that it is declared with."""
    types = get_type_hints(kind)
    if not isinstance(values, dict) or set(values) != {field.name for field in fields(kind)}:
        raise ValueError(f"its settings are not those of {kind.__name__}")
    return kind(**{name: _setting(name, types[name], value) for name, value in values.items()})


def _setting(name: str, kind: Any, value: Any) -> Any:
    if is_dataclass(kind) and isinstance(kind, type):
        return _settings(kind, value)
    allowed = get_args(kind) if get_origin(kind) is Literal else ()
    # float) and not abs | NaN, which Python's JSON can hold, fails this comparison too.
    if isinstance(value, int | float) and not abs(value) <= _LARGEST:
        raise ValueError(f"its setting {name} is not a number up to {_LARGEST:g}")
    # The exact type: to isinstance, true is a number.
    if value in allowed or (not allowed and type(value) in (get_args(kind) or (kind,))):
        return value
    raise ValueError(f"its setting {name} can't be {value!r}")


def _read_forest(path: Path) -> Trees:
    from safetensors import SafetensorError
    from safetensors.numpy import load_file

    current().admit(path)
    try:
        return Trees.read(load_file(path))
    except (OSError, SafetensorError, ValueError, KeyError, TypeError) as error:
        raise InvalidFile(f"this is no forest: {reason(error)}", path=path) from None
