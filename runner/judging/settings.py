"""The settings of a run: everything that is chosen besides the scenario and the
values of its parameters.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self, TypedDict, Unpack

from runner.judging.measures.measure import NEW_FAILURE, Limit
from schemas.common.errors import UsageError, nearest
from schemas.common.policy import current
from schemas.common.terminal.options import (
    CATALOG_PATH,
    READ,
    ROAD_PATH,
    FileUse,
    completed,
    option,
    options_of,
)
from schemas.common.terminal.settings_file import Setting, read, settings_of, values_of

if TYPE_CHECKING:
    from runner.systems import System

DEFAULT_SYSTEM = "cas"
"""The system under test that drives the ego unless another one is chosen."""
WORLDS = ("sumo", "kinematic")
"""The worlds by name: SUMO, or scripted motion without a simulator."""
MADE = "auto"
"""Setting `road` for straight roads with the lanes and lengths that a scenario's positions use"""
_TIMESTEPS = 0.001, 1.0
_LONGEST = 1e6
_FAIL_IF = Setting("fail-if", "fail_if", list[str], None, True, None)
"""Limits in settings files, which are an option of batches"""


def _systems() -> tuple[str, list[tuple[str, str]]]:
    from runner.systems import systems  # takes long to load

    return "Systems under test", list(systems().items())


class SettingChanges(TypedDict, total=False):
    """Settings by name, as functions take them: the fields of `RunSettings`."""

    timestep: float
    sut: str | System | None
    sut_timeout: float
    sut_in_process: bool
    ego: str | None
    seed: int
    max_time: float
    world: str
    end_after_collision: bool | None
    fail_if: tuple[str, ...]
    least: tuple[str, ...]
    enforce_constraints: bool
    strict: bool
    road: str | None
    road_path: tuple[str, ...]
    catalog_path: tuple[str, ...]


@dataclass(frozen=True)
class RunSettings:
    """Settings of a run, the same for one run, a batch, an export or a search.

    Args:
        timestep: s.
        sut: the system under test that drives the ego: a name of the entry-point group `xosc.sut`,
            `module:Class`, `FILE.py:Class`, an instance, or None (as `none`) for what the scenario
            scripts alone. A class that is given by name and none of the toolchain's runs in a
            process of its own.
        sut_timeout: time that such a process has for each answer, s; its start has 60 s at least.
        sut_in_process: keep such a class in this process.
        ego: name of the ego entity; found by `runner.systems.drivers.find_ego` where it is None.
        seed: of everything random in a run.
        max_time: limit of simulated time, s: scenarios without a StopTrigger have no end of their
            own.
        world: one of `WORLDS`.
        end_after_collision: end a run one second after the ego's first contact; None for runs with
            a system under test.
        fail_if: limits by which a run fails besides collisions of the ego, as `min_ttc<1` or
            `off-road`; see `runner.judging.measures.measure`.
        least: least values of evidence without which a run is inconclusive, as `ego_seconds=2`, in
            the place of those of `runner.judging.evidence.least.ROWS`.
        enforce_constraints: refuse parameter values that violate their constraint groups, and leave
            such sets of a distribution out; otherwise violations are noted in the event log.
        strict: refuse files that break their standard, where they are otherwise repaired with a
            remark.
        road: for scenarios that name no road network, or one that is missing: an OpenDRIVE file, or
            `auto` for straight roads with the lanes and lengths that the positions use; None
            refuses them where they need a road.
        road_path: folders in which road networks are looked for that are not where the scenario
            says (see `xosc.document.road_files`).
        catalog_path: folders in which directories of catalogues are, likewise (see
            `schemas.catalogs.locate`).

    Raises:
        UsageError: a value is out of its range, or there is no such world, system under test or
            limit.

    Example:
        >>> import xosc_toolchain as xt
        >>> settings = xt.RunSettings(sut="adas", timestep=0.1, world="kinematic", max_time=1.0)
        >>> xt.run("xosc/library/simple_cut_in.xosc", settings).end_time
        1.0
    """

    timestep: float = option(0.05, "Time step.", metavar="SECONDS", shared=True)
    sut: str | System | None = option(
        DEFAULT_SYSTEM,
        "System under test that drives the ego; with arguments: NAME:PARAMETER=VALUE,...",
        type=str,
        section=_systems,
        files=FileUse.WITHIN,
        metavar="SYSTEM",
        autocompletion=completed(lambda: [name for name, _ in _systems()[1] if name.islower()]),
        shared=True,
    )
    sut_timeout: float = option(
        60.0,
        "Time that a class of yours has for each answer, its start included.",
        metavar="SECONDS",
        shared=True,
    )
    sut_in_process: bool = option(
        False,
        "Run a class of yours in this process: faster, but its end is the command's.",
        "--sut-in-process",
        shared=True,
    )
    ego: str | None = option(
        None, "The ego, where it is not found by itself.", metavar="NAME", shared=True
    )
    seed: int = option(0, "Seed of everything random.", shared=True)
    max_time: float = option(
        300.0, "Limit of simulated time for each run.", metavar="SECONDS", shared=True
    )
    world: str = option(
        "sumo", "sumo, or kinematic: scripted motion without a simulator.", shared=True
    )
    end_after_collision: bool | None = option(
        None,
        "End a run one second after the ego's first contact.  [default: with a system under test]",
        "--end-after-collision/--continue-after-collision",
        show_default=False,
        shared=True,
    )
    fail_if: tuple[str, ...] = ()
    least: tuple[str, ...] = option(
        (),
        "Least value of evidence without which a run is inconclusive, as ego_seconds=2 (see "
        "docs/batches.md).",
        "--least",
        metavar="NAME=VALUE",
        shared=True,
    )
    enforce_constraints: bool = option(
        True,
        "Refuse parameter values that violate constraint groups; leave such sets of a "
        "distribution out.",
        "--constraints/--no-constraints",
        shared=True,
    )
    strict: bool = option(
        False,
        "Refuse files that break their standard instead of repairing them with a remark.",
        "--strict",
        shared=True,
    )
    road: str | None = option(
        None,
        "Where the road network is missing: an OpenDRIVE file; auto: straight roads as the "
        "positions use them.",
        files=READ,
        metavar="FILE|auto",
        shared=True,
    )
    road_path: tuple[str, ...] = option(
        (),
        ROAD_PATH,
        "--road-path",
        files=READ,
        metavar="DIR",
        shared=True,
    )
    catalog_path: tuple[str, ...] = option(
        (),
        CATALOG_PATH,
        "--catalog-path",
        files=READ,
        metavar="DIR",
        shared=True,
    )

    def __post_init__(self) -> None:
        shortest, longest = _TIMESTEPS
        if not shortest <= self.timestep <= longest:
            raise UsageError(
                f"the time step must be from {shortest:g} s to {longest:g} s, not {self.timestep}"
            )
        if not 0.0 <= self.max_time <= _LONGEST:
            raise UsageError(
                f"the time limit must be from 0 s to {_LONGEST:g} s, not {self.max_time}"
            )
        if self.world not in WORLDS:
            raise UsageError(
                f"the world {self.world!r} is not one of {', '.join(WORLDS)}; "
                f"{nearest(self.world, WORLDS)}"
            )
        if self.road not in (None, MADE) and not os.path.isfile(self.road):
            raise UsageError(f"the road {self.road!r} is neither a file nor {MADE}")
        _ = self.limits, self.least_values  # parsed once, or refused here
        # A limit beyond the longest run could never fail one, and would be green for ever.
        for limit in self.limits:
            if (
                limit.name == "end_time"
                and limit.comparison.startswith(">")
                and limit.value > self.max_time
            ):
                raise UsageError(
                    f"--fail-if {limit.text!r}: no run takes longer than --max-time "
                    f"{self.max_time:g}"
                )
        if not 0.0 < self.sut_timeout <= _LONGEST:
            raise UsageError(
                f"--sut-timeout must be above 0 s, at most {_LONGEST:g} s, not {self.sut_timeout}"
            )
        if isinstance(self.sut, str):
            from runner.systems import check_system

            check_system(self.sut, self.sut_in_process, self.sut_timeout)

    @classmethod
    def of_project(cls, **changes: Unpack[SettingChanges]) -> Self:
        """Return the settings of the project's file (`xosc.toml`, see docs/settings.md), the
        defaults where there is none.

        Under --untrusted it is not read.

        Args:
            changes: settings by name, that replace those of the file.

        Raises:
            InvalidFile: the file is malformed or has unknown keys.
            UsageError: a value is out of its range.

        Example:
            >>> import xosc_toolchain as xt
            >>> xt.RunSettings.of_project(sut="adas").sut
            'adas'
        """
        # The file may name a system under test, which is code.
        file = None if current().untrusted else read()
        if file is None:
            return cls(**changes)
        known = {**settings_of(options_of(cls)), "fail-if": _FAIL_IF}
        values: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value
            for name, value in values_of(file, known, "").items()
        }
        # `new-failure` compares batches: as a limit of one run `Limit.parse` refuses it.
        limits = tuple(
            criterion for criterion in values.get("fail_if", ()) if criterion.strip() != NEW_FAILURE
        )
        values |= {"fail_if": limits, **changes}
        return cls(**values)

    @classmethod
    def chosen(cls, settings: Self | None, changes: SettingChanges) -> Self:
        """Return settings with changes; the project's settings by default.

        Raises:
            UsageError: a change is of no setting, or a value is out of its range.
        """
        known = [field.name for field in fields(cls)]
        for name in changes:
            if name not in known:
                near = nearest(name, [*known, "parameters"])  # which callers take beside settings
                raise UsageError(f"there is no setting {name!r}; {near}")
        return cls.of_project(**changes) if settings is None else replace(settings, **changes)

    @property
    def ends_after_collision(self) -> bool:
        """Value of `end_after_collision`, or by default whether a system under
        test drives the ego.
        """
        from runner.systems import system_name

        return (
            system_name(self.sut) != "none"
            if self.end_after_collision is None
            else self.end_after_collision
        )

    @cached_property
    def limits(self) -> tuple[Limit, ...]:
        """Limits of `fail_if`."""
        return tuple(map(Limit.parse, self.fail_if))

    @cached_property
    def least_values(self) -> dict[str, float]:
        """Least values of `least` by name."""
        if not self.least:
            return {}
        from runner.judging.evidence.least import least_values

        return least_values(self.least)

    def as_json(self) -> dict[str, Any]:
        """The values by name, as JSON has them; a system under test by its name."""
        from runner.systems import system_name

        values = {field.name: getattr(self, field.name) for field in fields(self)}
        lists = {
            name: list(getattr(self, name))
            for name in ("fail_if", "least", "road_path", "catalog_path")
        }
        return (
            values
            | lists
            | {"sut": system_name(self.sut), "end_after_collision": self.ends_after_collision}
        )
