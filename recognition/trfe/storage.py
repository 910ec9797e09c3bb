"""TRFE models in a folder: `model.safetensors` (settings, samples, screening, prototypes),
`forest.skops`, the encoder's files.

No file is trusted: reading runs no code of it, settings must be of the types of `Config`, arrays
finite and of fitting shapes, and trees sound, since scikit-learn follows their node numbers without
looking whether there are such nodes.
"""

from __future__ import annotations

import json
import re
import zipfile
from dataclasses import asdict, fields, is_dataclass
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import RandomForestClassifier
from sklearn.tree import DecisionTreeClassifier

from recognition.trfe.config import Config, Steps
from recognition.trfe.forest import Neighbours, VotingForest
from recognition.trfe.forest.known import KnownClasses, Labelled, labelled
from recognition.trfe.forest.screening import EvtJoint
from recognition.trfe.inputs.samples import UNKNOWN, Prototypes, matrix
from recognition.trfe.inputs.tokens import CHANGES, Tokens
from recognition.trfe.trfe import TRFE
from schemas.common.array_types import IntArray
from schemas.common.errors import InvalidFile, ToolchainError, UsageError, reason
from schemas.common.policy import current
from schemas.common.storage import keep, writing

if TYPE_CHECKING:
    from recognition.trfe.encoder.model import Encoder

Arrays = dict[str, NDArray[Any]]
_MODEL, _FOREST, _ENCODER = "model.safetensors", "forest.skops", "encoder"
_FORMAT = "xosc-toolchain TRFE 5"
_ABOUT = "about"
"""The only metadata key: safetensors writes several in an order that varies"""
_TREE = "sklearn.tree._tree.Tree"
"""The only type beyond skops' defaults: node tables, which `_check_tree` verifies."""
_ADDRESS = re.compile(r'(?<="__id__": )\d+|\d+(?=\.npy\b)')
"""Addresses of objects in the schema and in the names of members of a file of skops"""
_PROTOCOL, _MOST = 2, 2**20
_NODES = {
    ("sklearn.ensemble._forest", "RandomForestClassifier", "ObjectNode"),
    ("sklearn.tree._classes", "DecisionTreeClassifier", "ObjectNode"),
    ("sklearn.tree._tree", "Tree", "TreeNode"),
    *(
        ("builtins", *pair)
        for pair in (("dict", "DictNode"), ("list", "ListNode"), ("tuple", "TupleNode"))
    ),
    *(("builtins", "str", loader) for loader in ("JsonNode", "TypeNode")),
    *(("numpy", name, "NdArrayNode") for name in ("ndarray", "int64")),
}
"""Module, class and loader of all nodes of a forest"""
LARGEST = 2**30
"""Bytes that a forest may unpack to."""


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
    with writing("the model", folder):
        keep(
            safetensors.save(
                {name: np.asarray(value, order="C") for name, value in arrays.items()}, about
            ),
            folder / _MODEL,
        )
        keep(known.forest.stored or _written(known.forest.trees), folder / _FOREST)
        for number, encoder in enumerate(model.encoders):
            from recognition.trfe.encoder import storage

            storage.save(encoder, folder / f"{_ENCODER}{number}")


def load(folder: Path) -> TRFE:
    """Read what `save` wrote.

    Raises:
        InvalidFile: a file is missing, truncated, not such a model's, or not to be trusted.
    """
    config, unseen, arrays = _read_model(folder / _MODEL)
    forest, stored = _read_forest(folder / _FOREST)
    encoders = _read_encoders(folder)
    try:
        model = TRFE(config, encoders, _known(config, arrays, forest, stored))
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


def _read_encoders(folder: Path) -> list[Encoder]:
    from recognition.trfe.encoder import storage

    places = sorted(folder.glob(f"{_ENCODER}[0-9]"))
    return [storage.load(place) for place in places]


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


def _known(
    config: Config, arrays: Arrays, forest: RandomForestClassifier, stored: bytes
) -> KnownClasses:
    fitted, calibrating = (labelled(**_part(arrays, name)) for name in ("fitted", "calibrating"))
    prototypes = Prototypes(**_part(arrays, "prototypes"))
    screening = EvtJoint(seed=config.seed).restore(_part(arrays, "screening"))
    voting = VotingForest(forest, Neighbours(**_part(arrays, "neighbours")), stored)
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
    if isinstance(value, int | float) and not abs(value) <= _LARGEST:
        raise ValueError(f"its setting {name} is not a number up to {_LARGEST:g}")
    if value in allowed or (not allowed and type(value) in (get_args(kind) or (kind,))):
        return value
    raise ValueError(f"its setting {name} can't be {value!r}")


def _written(forest: RandomForestClassifier) -> bytes:
    import skops.io

    return _without_circumstances(skops.io.dumps(forest, compression=zipfile.ZIP_DEFLATED))


def _without_circumstances(content: bytes) -> bytes:
    """A forest's file with numbers in their order for addresses of objects, which skops names by
    them, and without a time."""
    with zipfile.ZipFile(BytesIO(content)) as archive:
        files = {entry.filename: archive.read(entry) for entry in archive.infolist()}
    schema = files["schema.json"].decode()
    numbers = {
        address: str(number)
        for number, address in enumerate(dict.fromkeys(_ADDRESS.findall(schema)), 1)
    }
    files["schema.json"] = _ADDRESS.sub(lambda found: numbers[found[0]], schema).encode()
    out = BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(
                zipfile.ZipInfo(_ADDRESS.sub(lambda found: numbers[found[0]], name)),
                data,
                zipfile.ZIP_DEFLATED,
            )
    return out.getvalue()


def _read_forest(path: Path) -> tuple[RandomForestClassifier, bytes]:
    """A forest, and the content of its file."""
    current().admit(path)
    try:
        content = path.read_bytes()
        return _parsed(content), content
    except Exception as error:
        raise InvalidFile(f"this is no forest: {reason(error)}", path=path) from None


@lru_cache(maxsize=1)
def _parsed(content: bytes) -> RandomForestClassifier:
    """The forest of a file; the last one is kept, as a loop reads the same model for each of its
    catalogues."""
    import skops.io

    with zipfile.ZipFile(BytesIO(content)) as archive:
        if sum(entry.file_size for entry in archive.infolist()) > LARGEST:
            raise ValueError("it is too large")
        files = {entry.filename: archive.read(entry) for entry in archive.infolist()}
    forest = skops.io.loads(
        _checked(files), trusted=[_TREE]
    )  # looks through the types of all that is in it before it makes any
    _check_forest(forest)
    return forest


def _checked(files: dict[str, bytes]) -> bytes:
    """The file of a forest again, after all nodes of its schema have shown to be those of a forest.

    Nodes get numbers of their own: skops takes a number that it has met for the node that had it,
    whatever this one holds.
    """
    schema = json.loads(files["schema.json"])
    if schema.get("protocol") != _PROTOCOL:
        raise ValueError(f"protocol {_PROTOCOL} of skops is expected")
    waiting: list[Any] = [schema]
    number = 0
    while waiting:
        one = waiting.pop()
        waiting += [
            member
            for member in (one.values() if isinstance(one, dict) else one)
            if isinstance(member, dict | list)
        ]
        if isinstance(one, dict) and "__loader__" in one:
            if (one.get("__module__"), one.get("__class__"), one["__loader__"]) not in _NODES:
                raise ValueError(f"{one.get('__class__')} is no part of a forest")
            number += 1
            one["__id__"] = number
            if one["__loader__"] == "TreeNode":
                _check_arguments(one, files)
    out = BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:
        for name, data in (files | {"schema.json": json.dumps(schema).encode()}).items():
            archive.writestr(name, data)
    return out.getvalue()


def _check_arguments(node: dict[str, Any], files: dict[str, bytes]) -> None:
    """Numbers of features, classes, outputs and nodes of a tree, which scikit-learn takes for sizes
    of the arrays beside them."""

    def number(one: dict[str, Any]) -> int:
        found = json.loads(one["content"])
        if one["__loader__"] != "JsonNode" or type(found) is not int:
            raise ValueError("a number is expected")
        return found

    def array(one: dict[str, Any]) -> NDArray[Any]:
        if one["__loader__"] != "NdArrayNode" or one["type"] != "numpy":
            raise ValueError("an array is expected")
        found: NDArray[Any] = np.lib.format.read_array(
            BytesIO(files[one["file"]]), allow_pickle=False
        )
        return found

    features, classes, outputs = node["__reduce__"]["args"]["content"]
    state, counts = node["content"]["content"], array(classes)
    nodes = array(state["nodes"])
    sound = (
        0 < number(features) < _MOST
        and number(outputs) == 1
        and counts.shape == (1,)
        and counts.dtype == np.intp
        and 0 < int(counts[0]) < _MOST
        and nodes.ndim == 1
        and number(state["node_count"]) == len(nodes)
    )
    if not sound:
        raise ValueError("one of its trees is broken")


def _check_forest(forest: Any) -> None:
    if type(forest) is not RandomForestClassifier or not forest.estimators_:
        raise ValueError(f"it is a {type(forest).__name__}")
    classes: IntArray = forest.classes_
    if (
        not np.issubdtype(classes.dtype, np.integer)
        or classes.ndim != 1
        or (np.diff(classes) <= 0).any()
        or classes[0] < UNKNOWN
    ):
        raise ValueError("its classes are no ascending numbers")
    for tree in forest.estimators_:
        if type(tree) is not DecisionTreeClassifier:
            raise ValueError(f"one of its trees is a {type(tree).__name__}")
        _check_tree(tree, len(classes), forest.n_features_in_)


def _check_tree(tree: DecisionTreeClassifier, classes: int, width: int) -> None:
    """Children come after their parents, so that every path ends, and features and classes are
    those of the forest."""
    nodes = tree.tree_
    number, left, right = np.arange(nodes.node_count), nodes.children_left, nodes.children_right
    inner = left >= 0
    sound = (
        nodes.node_count > 0
        and nodes.n_features == width
        and nodes.value.shape == (nodes.node_count, 1, classes)
        and (inner == (right >= 0)).all()
        and all(
            (child[inner] > number[inner]).all() and (child < nodes.node_count).all()
            for child in (left, right)
        )
        and ((nodes.feature[inner] >= 0) & (nodes.feature[inner] < width)).all()
        and np.isfinite(nodes.value).all()
    )
    if not sound:
        raise ValueError("one of its trees is broken")
