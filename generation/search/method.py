"""The search methods by name: MCSG, what it is compared with, and its ablations."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, NamedTuple

from generation.search.problem import History, Problem
from schemas.errors import UsageError

Search = Callable[[Problem, int, int], History]
"""Spends a budget of simulator calls on a problem, all that is drawn by a seed."""


class Method(NamedTuple):
    """Where a method is, and what it is.

    Attributes:
        module: below `generation`; its `search` is the method.
        title: for tables.
        meaning: one line for people.
        realistic: whether it keeps to what is plausible: its reward has a realism term, or it draws from recorded parameters.
        knots: whether its problem is that of trajectories (`generation.study.knots`), not that of manoeuvres.
    """

    module: str
    title: str
    meaning: str
    realistic: bool
    knots: bool = False

    @property
    def path(self) -> str:
        """The module of the search."""
        return f"generation.{self.module}"


METHODS = {
    "mcsg": Method("mcsg.search", "**MCSG**", "reinforcement learning of edits to real scenarios, coarse to fine", True),
    "random": Method("search.methods.random", "random", "uniform in the box", False),
    "kde": Method("search.methods.kde", "KDE sampling", "draws from the density of recorded parameters", True),
    "conscend": Method("search.methods.conscend", "ConScenD", "replays recorded parameters, no search", True),
    "cma-es": Method("study.baselines.cma_es", "CMA-ES", "evolution strategy on MCSG's reward, with restarts", True),
    "gacs": Method("study.baselines.gacs", "GACS", "genetic algorithm on criticality", False),
    "ibo": Method("study.baselines.ibo", "IBO", "Bayesian optimisation of criticality", False),
    "ccsf": Method("study.baselines.ccsf", "CCSF", "REINFORCE with an LSTM, on criticality", False),
    "rltester": Method(
        "study.baselines.rltester", "RLTester", "deep Q-network, one step of one parameter at a time, least TTC", False
    ),
    "rlbe": Method("study.baselines.rlbe", "RLBE", "proximal policy optimisation of edits, risk and plausibility", True),
    "no-rl": Method(
        "study.ablations.no_rl", "No-RL", "MCSG's reward and starts, a genetic algorithm in place of the policy", True
    ),
    "no-kde": Method("study.ablations.no_kde", "No-KDE", "MCSG without the realism term", False),
    "no-maneuver": Method("mcsg.search", "No-Maneuver", "MCSG on trajectories, without manoeuvre parameters", True, knots=True),
    "no-learning": Method("study.ablations.no_learning", "No-Learning", "MCSG with an untrained policy", True),
    "no-elite": Method("study.ablations.no_elite", "No-Elite", "MCSG that starts from real scenarios throughout", True),
    "no-coordination": Method("study.ablations.no_coordination", "No-Coordination", "MCSG with edits of single parameters", True),
    "exclusive": Method(
        "study.ablations.exclusive", "exclusive reward", "MCSG where a collision pays the same whatever R_risk", True
    ),
}
"""In the order of tables."""
ABLATIONS = ("no-rl", "no-kde", "no-maneuver", "no-learning", "no-elite", "no-coordination", "exclusive")
"""Those that are MCSG without a part of it."""


def method(name: str) -> Search:
    """The search of that name.

    Raises:
        UsageError: there is none.
    """
    if name not in METHODS:
        raise UsageError(f"there is no search method {name!r}; methods: {', '.join(METHODS)}")
    search: Search = import_module(METHODS[name].path).search
    return search


def need(module: str) -> Any:
    """A module of an optional library.

    Raises:
        UsageError: it is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        library = module.partition(".")[0]
        if error.name != library:
            raise
        raise UsageError(f"this search method needs {library}: pip install 'xosc-toolchain[search]'") from None
