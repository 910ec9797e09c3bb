"""What the packages show to their users."""

from __future__ import annotations

from importlib import import_module, metadata
from pathlib import Path

import pytest

PACKAGES = ("schemas", "xosc", "xodr", "runner", "recognition", "generation")


@pytest.mark.parametrize("name", PACKAGES)
def test_a_package_shows_its_names_its_version_and_that_it_is_typed(name):
    package = import_module(name)
    assert {*package.__all__, "__version__"} <= set(dir(package))
    assert all(getattr(package, public) is not None for public in package.__all__)
    assert package.__version__ == metadata.version("xosc-toolchain")
    assert (Path(str(package.__file__)).parent / "py.typed").is_file()
    with pytest.raises(AttributeError, match=f"module '{name}' has no attribute 'nothing'"):
        package.nothing


@pytest.mark.parametrize("name", PACKAGES)
def test_no_module_imports_all_names_of_another(name):
    folder = Path(str(import_module(name).__file__)).parent
    assert [path for path in folder.rglob("*.py") if "import *" in path.read_text(encoding="utf-8")] == []
