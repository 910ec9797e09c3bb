"""Everything public under one import: `import xosc_toolchain as xt`.

The names of the packages are general (`xosc`, `runner`, …) and may be those of your own modules;
this one is not. A name is loaded when it is first used, so that the import itself takes no time:

    import xosc_toolchain as xt

    result = xt.run("xosc/library/simple_cut_in.xosc", sut="adas")
    print(result.verdict, result.end_time)
"""

from __future__ import annotations

# but for type checkers; to import `typing` takes time, in which no signal is answered yet
TYPE_CHECKING = False

if TYPE_CHECKING:
    from generation.pipeline import generate as search
    from generation.search.settings import SearchSettings as SearchSettings
    from recognition.catalogue.pipeline import build as recognise
    from recognition.trfe.trfe import TRFE as TRFE
    from runner.judging.execution import Prepared as Prepared
    from runner.judging.execution import Session as Session
    from runner.judging.execution import prepare as prepare
    from runner.judging.execution import run as run
    from runner.judging.measures.criticality import Criticality as Criticality
    from runner.judging.measures.measure import measures as measures
    from runner.judging.result import RunResult as RunResult
    from runner.judging.result import Verdict as Verdict
    from runner.judging.settings import RunSettings as RunSettings
    from runner.systems import Control as Control
    from runner.systems import Observation as Observation
    from runner.systems import Participant as Participant
    from runner.systems import Pose as Pose
    from runner.systems import SystemUnderTest as SystemUnderTest
    from runner.systems import load_system as load_system
    from runner.systems import systems as systems
    from runner.systems.arrays import BatchControl as BatchControl
    from runner.systems.arrays import BatchObservation as BatchObservation
    from runner.view.replay.notebook import show as show
    from runner.view.replay.player import write_replay as replay
    from runner.view.report import write_report as report
    from schemas import Problem as Problem
    from schemas import check as check
    from schemas import check_many as check_many
    from schemas.common.errors import InvalidFile as InvalidFile
    from schemas.common.errors import ToolchainError as ToolchainError
    from schemas.common.errors import Unsupported as Unsupported
    from schemas.common.errors import UsageError as UsageError
    from xodr import RoadNetwork as RoadNetwork
    from xodr import load as load_road
    from xodr.formats.maps import files as road
    from xosc import Document as Document
    from xosc import convert as convert
    from xosc import load as load
    from xosc import resolve as resolve
    from xosc import variations as variations
    from xosc import write as write

    __version__: str
else:
    _HOMES = {
        "BatchControl": "runner.systems.arrays",
        "BatchObservation": "runner.systems.arrays",
        "Control": "runner.systems",
        "Criticality": "runner.judging.measures.criticality",
        "Document": "xosc",
        "InvalidFile": "schemas.common.errors",
        "Observation": "runner.systems",
        "Participant": "runner.systems",
        "Pose": "runner.systems",
        "Prepared": "runner.judging.execution",
        "Problem": "schemas",
        "RoadNetwork": "xodr",
        "RunResult": "runner.judging.result",
        "RunSettings": "runner.judging.settings",
        "SearchSettings": "generation.search.settings",
        "Session": "runner.judging.execution",
        "SystemUnderTest": "runner.systems",
        "TRFE": "recognition.trfe.trfe",
        "ToolchainError": "schemas.common.errors",
        "Unsupported": "schemas.common.errors",
        "UsageError": "schemas.common.errors",
        "Verdict": "runner.judging.result",
        "check": "schemas",
        "check_many": "schemas",
        "convert": "xosc",
        "load": "xosc",
        "load_road": "xodr:load",
        "load_system": "runner.systems",
        "measures": "runner.judging.measures.measure",
        "prepare": "runner.judging.execution",
        "recognise": "recognition.catalogue.pipeline:build",
        "road": "xodr.formats.maps.files:",
        "replay": "runner.view.replay.player:write_replay",
        "report": "runner.view.report:write_report",
        "resolve": "xosc",
        "run": "runner.judging.execution",
        "search": "generation.pipeline:generate",
        "show": "runner.view.replay.notebook",
        "systems": "runner.systems",
        "variations": "xosc",
        "write": "xosc",
    }

    def __getattr__(name):
        from schemas.common.packages import offer, public
        from xosc_toolchain.start import OFFERED

        offer(OFFERED)
        return public(__name__, _HOMES)[0](name)

    def __dir__():
        from schemas.common.packages import public

        return public(__name__, _HOMES)[1]()


__all__ = [
    "TRFE",
    "BatchControl",
    "BatchObservation",
    "Control",
    "Criticality",
    "Document",
    "InvalidFile",
    "Observation",
    "Participant",
    "Pose",
    "Prepared",
    "Problem",
    "RoadNetwork",
    "RunResult",
    "RunSettings",
    "SearchSettings",
    "Session",
    "SystemUnderTest",
    "ToolchainError",
    "Unsupported",
    "UsageError",
    "Verdict",
    "check",
    "check_many",
    "convert",
    "load",
    "load_road",
    "load_system",
    "measures",
    "prepare",
    "recognise",
    "replay",
    "report",
    "resolve",
    "road",
    "run",
    "search",
    "show",
    "systems",
    "variations",
    "write",
]
