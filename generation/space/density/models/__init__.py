"""Density models by name: classes of this folder's modules, described by a literal `DENSITIES` in
each."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from importlib import import_module, metadata
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from zipfile import BadZipFile

from schemas.common.errors import UsageError, guess
from schemas.common.packages import described
from schemas.common.storage import ForeignCache, cache_folder, fingerprint, keep

if TYPE_CHECKING:
    from generation.space.density.base import Density

DEFAULT = "kde"
"""The density of the publication."""
JUDGE = "mixture"
"""The density that says what is foreseeable: the likeliest to recordings that it has not seen of
those that pass the gate (`python -m studies.generation densities`)."""
_OF_PAIRS = "student"
"""The judge in the place of the mixture where there are few units of many parameters: pairs of
adversaries. 6 % of recorded pairs lie outside what 99 % of the mixture's draws keep within, and 1 %
outside that of this one."""
UNIFORM = "uniform"
"""Name of the density of parameters of which nothing is known but their limits."""


class Model(NamedTuple):
    """Density model: location and description.

    Attributes:
        module: full name.
        name: of its class.
        title: for tables.
    """

    module: str
    name: str
    title: str


def judge(name: str, pairs: bool) -> str:
    """The density that judges where one of that name is asked for.

    Args:
        pairs: whether it is of pairs of units.
    """
    return _OF_PAIRS if pairs and name == JUDGE else name


def models() -> dict[str, Model]:
    """The models by name, the default one first; none of them is imported."""
    # Described in the sources: importing the models would load torch and scikit-learn.
    by_name = {
        name: Model(f"{__name__}.{module}", description["class"], description["title"])
        for module, densities in described(__name__, "DENSITIES").items()
        for name, description in densities.items()
    }
    return {DEFAULT: by_name.pop(DEFAULT), **dict(sorted(by_name.items()))}


def model(name: str) -> Density:
    """A new model with its defaults.

    Raises:
        UsageError: no model has that name.
    """
    by_name = models()
    if name not in by_name:
        raise UsageError(
            f"there is no density {name!r}; {guess(name, by_name)}densities: {', '.join(by_name)}"
        )
    new: Density = getattr(import_module(by_name[name].module), by_name[name].name)()
    return new


def cached(name: str, key: bytes, fit: Callable[[], list[Density]]) -> list[Density]:
    """Fitted models from the cache folder; fitted, and put there, where they are not in it.

    Args:
        name: of the model.
        key: digest of all that they are fitted on.
        fit: fits them.
    """
    import numpy as np  # names of models are asked for without it

    from generation.space.density.base import Density

    kind = type(model(name))
    if kind.restore is Density.restore:
        return fit()
    # Models that other code has fitted are not taken for these.
    code = b"".join(
        Path(str(import_module(part).__file__)).read_bytes()
        for part in (kind.__module__, Density.__module__)
    )
    made_by = f"{name} {metadata.version('scikit-learn')} {np.__version__}".encode()
    try:
        path = cache_folder("densities") / f"{fingerprint(key + made_by + code)}.npz"
    except ForeignCache:
        return fit()
    try:
        with np.load(path, allow_pickle=False) as found:
            return [
                kind().restore({part: found[f"{number}_{part}"] for part in parts.split()})
                for number, parts in enumerate(found["parts"].tolist())
            ]
    except (OSError, ValueError, KeyError, EOFError, BadZipFile):
        pass  # not there, or damaged
    densities, content = fit(), BytesIO()
    arrays = [density.arrays() or {} for density in densities]
    columns: dict[str, Any] = {
        f"{number}_{part}": values
        for number, of in enumerate(arrays)
        for part, values in of.items()
    }
    np.savez(content, parts=np.array([" ".join(of) for of in arrays]), **columns)
    with suppress(OSError):  # a cache that can't be written costs time, and nothing else
        keep(content.getvalue(), path)
    return densities
