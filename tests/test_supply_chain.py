"""Packages that the release installs: each pinned to a version and to the digests of its files."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

yaml = pytest.importorskip("yaml")

ROOT = Path(__file__).parents[1]
PINNED = re.compile(r"^([\w.-]+)==(\S+)", re.MULTILINE)
WITHOUT_DIGEST = {"torch"}
"""Packages with several builds of a version, of which users pick one"""


def name_of(package: str) -> str:
    """Return a package's name as indexes compare it."""
    return re.sub(r"[-_.]+", "-", package).lower()


def versions(text: str) -> dict[str, str]:
    """Return the pinned version by package."""
    return {name_of(name): version for name, version in PINNED.findall(text)}


LOCK = (ROOT / "requirements.lock").read_text(encoding="utf-8")
CONSTRAINTS = versions((ROOT / "constraints.txt").read_text(encoding="utf-8"))


def test_the_lock_has_the_versions_that_the_tests_ran_with() -> None:
    locked = versions(LOCK)
    assert {name: locked.get(name) for name in CONSTRAINTS if name not in WITHOUT_DIGEST} == {
        name: version for name, version in CONSTRAINTS.items() if name not in WITHOUT_DIGEST
    }, "constraints.txt was changed: run .ci/lock"
    assert not WITHOUT_DIGEST & locked.keys()


def test_each_package_has_digests_and_names_no_index() -> None:
    entries = re.split(r"\n(?=\S)", LOCK.split("\n", 1)[1].strip())
    assert len(entries) == len(versions(LOCK)) > len(CONSTRAINTS)
    for entry in entries:
        assert re.fullmatch(r"[\w.-]+==[\w.]+( \\\n {4}--hash=sha256:[0-9a-f]{64})+", entry), entry[
            :120
        ]


def test_every_direct_dependency_is_locked() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    named = [*project["build-system"]["requires"], *project["project"]["dependencies"]]
    for more in [
        *project["project"]["optional-dependencies"].values(),
        *project["dependency-groups"].values(),
    ]:
        named += more
    wanted = (
        {name_of(re.split(r"[\[<>=!~]", one)[0]) for one in named}
        - {"xosc-toolchain", "rtamt"}  # whose antlr4-python3-runtime 4.7 has no wheel
        - WITHOUT_DIGEST
    )
    assert not wanted - versions(LOCK).keys()


def test_the_release_installs_only_files_whose_digest_is_locked() -> None:
    workflow = yaml.safe_load(
        (ROOT / ".github" / "workflows" / "release.yml").read_text(encoding="utf-8")
    )
    commands = [
        line.strip()
        for step in workflow["jobs"]["release"]["steps"]
        for line in step.get("run", "").splitlines()
    ]
    (download,) = (command for command in commands if " pip download " in command)
    assert {"--require-hashes", "--only-binary", "requirements.lock"} <= set(download.split())
    installs = [command for command in commands if " pip install " in command]
    assert len(installs) == 3
    assert all("--no-index --find-links locked" in command for command in installs), installs
