"""Compile the modules that a step of a run spends its time in, with mypyc, into
a wheel of the platform.

Off by default. `make compiled` switches it on by `HATCH_BUILD_HOOK_ENABLE_CUSTOM`. The Python files
stay in the wheel; Python imports the extension modules beside them. A module with a
`cached_property` stays out: mypyc computes it anew each time.
"""

from __future__ import annotations

import os
import tempfile
from contextlib import chdir
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

MODULES = (
    "runner/engine/motion/dynamics.py",
    "runner/engine/motion/following.py",
    "runner/engine/motion/on_roads.py",
    "runner/engine/motion/placement.py",
    "runner/engine/motion/routes.py",
    "runner/engine/motion/spacing.py",
    "runner/engine/participants/boxes.py",
    "runner/engine/participants/declaration.py",
    "runner/engine/participants/entity.py",
    "runner/engine/storyboard/collision.py",
    "runner/engine/storyboard/departures.py",
    "runner/engine/storyboard/simulation.py",
    "runner/engine/storyboard/story_elements.py",
    "runner/engine/storyboard/storyboard.py",
    "runner/engine/storyboard/triggers.py",
    "xodr/graph/links.py",
    "xodr/graph/locate.py",
    "xodr/graph/travel.py",
    "xodr/graph/ways.py",
    "xodr/model/__init__.py",
    "xodr/model/geometry.py",
    "xodr/model/road.py",
)


class Compiled(BuildHookInterface[Any]):
    """Hook of hatchling that adds the extension modules to a wheel."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, unless the wheel only points to a checkout."""
        if self.target_name != "wheel" or version == "editable":
            return
        self._folder = tempfile.TemporaryDirectory()
        root, built = Path(self.root), Path(self._folder.name)
        for module in compile_modules(root, built):
            build_data["force_include"][str(module)] = module.relative_to(built).as_posix()
        build_data["pure_python"] = False
        build_data["infer_tag"] = True

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the files that were compiled."""
        if hasattr(self, "_folder"):
            self._folder.cleanup()


def compile_modules(root: Path, into: Path) -> list[Path]:
    """Compile `MODULES` of the tree at `root`; return the extension modules, in
    folders as theirs below `into`.
    """
    from mypyc.build import mypycify
    from setuptools import Distribution
    from setuptools.command.build_ext import build_ext

    with chdir(root), tempfile.TemporaryDirectory() as sources:
        extensions = mypycify(
            ["--follow-imports=silent", "--ignore-missing-imports", *MODULES],
            only_compile_paths=MODULES,
            target_dir=sources,
            opt_level="2",
            multi_file=True,
        )
        command = build_ext(Distribution({"name": "xosc_toolchain", "ext_modules": extensions}))
        command.build_lib, command.build_temp = str(into), sources
        command.parallel = os.cpu_count()
        command.finalize_options()
        command.run()
        return [Path(path) for path in command.get_outputs()]
