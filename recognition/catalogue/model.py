"""Detection by a model, and what its card says of sites that it has not seen."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
from threadpoolctl import threadpool_limits

from recognition.catalogue.detect import (
    DISCOVERED,
    KNOWN,
    MODEL,
    RULES,
    UNKNOWN,
    WINDOW,
    Moment,
    by_rules,
)
from recognition.labels.classes import Label, LabelledEvent, Rules
from recognition.labels.scene import is_parked
from recognition.scenes import Site
from recognition.scenes.lanes import on_lanes
from recognition.trfe import storage
from recognition.trfe.forest.known import FIRST_DISCOVERED, title_of
from recognition.trfe.inputs.samples import BACKGROUND, Features
from recognition.trfe.training.windows import STRIDE, drawn_in_parts, regular, visible
from recognition.trfe.trfe import TRFE
from runner.recording import Recording
from schemas.common.errors import InvalidFile, UsageError, reason
from schemas.common.policy import current
from schemas.common.storage import digest

AGREE, WRONG = 0.75, 0.10
"""Least share of rules' events that a model gives the rules' class, and greatest share that gets
another one or none"""
_WEIGHTS, _ABOUT, _FIELD = "model.safetensors", "about", "unseen_sites"


class UnseenSites(NamedTuple):
    """Agreement of a model with rules' events on sites outside its training, for the worst site
    measured.

    agree: share with the rules' class. wrong: share that is taken for another known class or for
    nothing; the rest is unknown.
    """

    agree: float
    wrong: float

    @property
    def sufficient(self) -> bool:
        """Whether catalogues may be sorted by such labels."""
        return self.agree >= AGREE and self.wrong <= WRONG

    def __str__(self) -> str:
        return (
            f"{self.agree:.0%} get their class from the model and "
            f"{self.wrong:.0%} another one or none"
        )


def unseen_sites(folder: Path) -> UnseenSites | None:
    """Return `unseen_sites` of the metadata of the model in a folder; None if absent.

    Raises:
        InvalidFile: there is no model, or what it states is no pair of shares.
    """
    from safetensors import SafetensorError, safe_open

    path = folder / _WEIGHTS
    current().admit(path)
    try:
        with safe_open(path, "numpy") as file:
            stated = json.loads((file.metadata() or {}).get(_ABOUT, "{}")).get(_FIELD)
        # A model without the statement is no error: it may label, and not sort.
        if stated is None:
            return None
        found = UnseenSites(float(stated["agree"]), float(stated["wrong"]))
    except (
        OSError,
        SafetensorError,
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        RecursionError,
    ) as error:
        raise InvalidFile(
            f"{_FIELD} can't be read from this model: {reason(error)}", path=path
        ) from None
    if not all(0.0 <= share <= 1.0 for share in found):
        raise InvalidFile(
            f"{_FIELD} of this model holds shares from 0 to 1, not {found.agree:g} and "
            f"{found.wrong:g}",
            path=path,
        )
    return found


def objection(stated: UnseenSites | None) -> str | None:
    """Reason for which a model with such a statement must not sort a catalogue;
    None where it may.
    """
    needed = f"at least {AGREE:.0%} and at most {WRONG:.0%} are required"
    if stated is None:
        return (
            "the model does not state how many of the rules' events on sites not seen get their "
            f"class, or another ({needed})"
        )
    return (
        None
        if stated.sufficient
        else f"of the rules' events on sites not seen, {stated} ({needed})"
    )


_DRAWN = 4096
"""Windows that are drawn and encoded at a time"""
_RULES = Rules()
Part = TypeVar("Part")
_NOTHING = title_of(BACKGROUND)


class ByModel:
    """Labels moments by a model, which discovers classes and applies them to later moments.

    Args:
        model: fitted, with its encoders.
        sorts: whether moments are sorted by the model's labels. Otherwise rules' events are sorted
            by the rules, and of the other moments those remain that are unknown to the model or of
            a class that it discovered.
        discover: whether moments that are unknown, or of a discovered class, are given as well;
            as on the command line not by default.
        name: of the model, such as the digest of its file.
        stride: time between two moments of one vehicle, s; a rule's event takes the place of the
            moments about it.
    """

    def __init__(
        self,
        model: TRFE,
        *,
        sorts: bool,
        discover: bool = False,
        stride: float = STRIDE,
        name: str = MODEL,
    ) -> None:
        if not model.encoders:
            raise UsageError("this model has no encoder: it can't recognise recordings")
        self._model, self._view, self._stride, self._sorts = (
            model,
            model.encoders[0].view,
            stride,
            sorts,
        )
        self._hidden = () if discover else (UNKNOWN, DISCOVERED)
        self.discovers, self.name = discover, f"{name}, discovering" if discover else name
        self._first = int(model.buffer.keys.max()) + 1 if len(model.buffer) else 0
        """key of the first moment in the buffer; smaller ones are of what waited there before"""
        self._ranges: dict[str, range] = {}
        self._seen: list[Moment] = []
        self._labels: list[int] = []
        self._waiting = 0
        """unknown moments since classes were looked for the last time"""
        self._finished = False

    by_rules = False
    """Discovered classes come from all recordings together"""

    @property
    def sorted_by(self) -> str:
        """Source of the labels that sort the moments."""
        return MODEL if self._sorts else RULES

    def look(
        self,
        name: str,
        recording: Recording,
        site: Site,
        events: list[LabelledEvent],
        advance: Callable[[float], None],
    ) -> None:
        """Recognise the moments of a recording; the unknown ones wait in the model's buffer."""
        # Rules' events first: their windows are centred on the event, where the class shows best.
        candidates = [*map(by_rules, events), *self._regular(recording, site, events)]
        # Windows that reach beyond the recording can't be encoded.
        inside = visible(
            recording, [(moment.ego, moment.time) for moment in candidates], self._view
        )
        moments = [moment for moment, usable in zip(candidates, inside, strict=True) if usable]
        self._ranges[name] = range(len(self._seen), len(self._seen) + len(moments))
        places = [(moment.ego, moment.time) for moment in moments]
        with threadpool_limits(
            1, "blas"
        ):  # more threads only wait, for products this small and beside the encoders' threads
            # Two stages of a pipeline: windows are drawn while the ones before are encoded.
            parts = map(
                self._model.encode,
                _ahead(drawn_in_parts(recording, places, self._view, site, _DRAWN)),
            )
            for number, features in enumerate(_ahead(parts)):
                self._take(features, moments[number * _DRAWN :])
                advance(len(features) / len(moments))
        if not moments:
            advance(1.0)

    def moments(self, name: str) -> list[Moment]:
        """Moments of a recording with their final labels, after all recordings were seen."""
        # Classes are discovered from all recordings together; the first question ends the looking.
        if not self._finished:
            self._discover()
            self._finished = True
        labelled = [
            self._labelled(self._seen[index], self._labels[index]) for index in self._ranges[name]
        ]
        found = [
            one
            for one in labelled
            if one.rule
            or one.severity is not None
            or (one.model != _NOTHING and (self._sorts or one.state != KNOWN))
        ]
        return [one for one in found if one.severity is not None or one.state not in self._hidden]

    def keep(self, folder: Path, *, waiting: bool = True) -> None:
        """Write the model as it is now: discovered classes are known to it.

        Args:
            folder: of the model.
            waiting: whether what is still unknown goes on waiting in its buffer, or is forgotten.

        Raises:
            UsageError: the folder can't be written.
        """
        if not waiting:
            self._model.buffer.remove(np.ones(len(self._model.buffer), dtype=bool))
        storage.save(self._model, folder)

    def _regular(
        self, recording: Recording, site: Site, events: list[LabelledEvent]
    ) -> list[Moment]:
        """Moments on lanes at the stride, away from the events, of vehicles that are not parked."""
        taken: dict[str, list[float]] = {}
        for event in events:
            taken.setdefault(event.ego, []).append(event.time)
        moments = []
        for track in recording.tracks.values():
            if track.kind == "vehicle" and not is_parked(track, _RULES):
                times = regular(track.columns["time"], WINDOW, self._stride)
                busy = np.array(taken.get(track.name, []))
                free = (np.abs(times[:, None] - busy) >= 0.5 * self._stride).all(axis=1)
                free &= on_lanes(recording, site.network, track.name, times)
                moments += [
                    Moment(track.name, at, Label.UNKNOWN.title, UNKNOWN)
                    for at in times[free].tolist()
                ]
        return moments

    def _take(self, features: Features, moments: list[Moment]) -> None:
        """Recognise windows by their features, of the first moments, no more at a time than fit
        into the buffer twice."""
        # Larger parts would push unknown moments out of the buffer before classes are looked for.
        part = max(self._model.buffer.capacity // 2, 1)
        for start in range(0, len(features), part):
            some = features[start : start + part]
            self._recognise(some, moments[start : start + len(some)])

    def _recognise(self, features: Features, moments: list[Moment]) -> None:
        found = self._model.observe(
            features, self._first + len(self._seen) + np.arange(len(moments))
        )
        names = [title_of(int(label)) for label in found.closed]
        shares = found.confidence.tolist()
        self._seen += (
            replace(one, nearest=name, confidence=round(share, 4))
            for one, name, share in zip(moments, names, shares, strict=True)
        )
        self._labels += found.labels.tolist()
        self._waiting += int((found.labels == Label.UNKNOWN).sum())
        # Half of the buffer is new since the last time: looking more often finds the same clusters.
        if self._waiting >= self._model.buffer.capacity // 2 and self._model.buffer.full:
            self._discover()

    def _discover(self) -> None:
        """Look for new classes among what waits, as soon as there is enough of it, and take them
        for known from then on."""
        self._waiting = 0
        if len(self._model.buffer) <= self._model.config.preprocessing.neighbours:
            return
        found = self._model.discover()
        # Keys below are of moments of earlier recordings: they have no place in this catalogue.
        ours = found.keys >= self._first
        for key, label in zip(found.keys[ours].tolist(), found.labels[ours].tolist(), strict=True):
            self._labels[key - self._first] = label
        self._model.expand(found)

    def _labelled(self, moment: Moment, label: int) -> Moment:
        """A moment with the model's final label, sorted by it unless a rule's event is sorted by
        the rules."""
        moment = replace(moment, model=title_of(label))
        if moment.rule and not self._sorts:
            return moment
        if moment.severity is not None and (label < FIRST_DISCOVERED or DISCOVERED in self._hidden):
            return moment  # critical and of no class, unless it is of a discovered one
        state = (
            UNKNOWN if label == Label.UNKNOWN else KNOWN if label < FIRST_DISCOVERED else DISCOVERED
        )
        return replace(moment, title=title_of(label), state=state)


def _ahead(parts: Iterator[Part]) -> Iterator[Part]:
    """The same parts, each made while the one before it is used."""
    with ThreadPoolExecutor(1) as thread:
        # One part ahead: more would only hold further blocks of windows in memory.
        coming = thread.submit(next, parts, None)
        while (part := coming.result()) is not None:
            coming = thread.submit(next, parts, None)
            yield part


def load(folder: Path, *, sorts: bool | None = None, discover: bool = False) -> ByModel:
    """A recogniser by the model in a folder.

    Args:
        sorts: as of `ByModel`; by default what the model states of sites not seen decides.
        discover: as of `ByModel`.

    Raises:
        UsageError: there is no model, or it can't take recordings.
        InvalidFile: it is not readable.
    """
    if not folder.is_dir():
        raise UsageError("there is no model in this folder; --labels rules needs none", path=folder)
    model = storage.load(folder)
    return ByModel(
        model,
        sorts=objection(unseen_sites(folder)) is None if sorts is None else sorts,
        discover=discover,
        name=f"{MODEL} {digest((folder / _WEIGHTS).read_bytes())}",
    )
