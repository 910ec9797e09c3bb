"""Every public scenario at hand loads, resolves with its defaults, and survives being written."""

from __future__ import annotations

import pytest

import xosc
from schemas.common.errors import InvalidFile

NEEDS_ABSENT_ASSETS = {"car_walk.xosc"}


@pytest.fixture(scope="module")
def scenarios(corpora):
    documents = [xosc.load(path) for path in sorted(corpora.rglob("*.xosc"))]
    return [document for document in documents if document.kind == "scenario"]


def test_defaults_resolve_to_literals(scenarios):
    assert len(scenarios) > 60
    for document in scenarios:
        if document.path.name in NEEDS_ABSENT_ASSETS:
            with pytest.raises(InvalidFile, match=r"directory .* does not exist"):
                xosc.resolve(document)
            continue
        resolved = xosc.resolve(document)
        symbolic = resolved.root.xpath("//@*[contains(., '$')][name() != 'name']")
        assert not symbolic, f"{document.path}: {symbolic}"
        assert not list(resolved.root.iter("CatalogReference"))
        assert resolved.logic_file is None or resolved.logic_file.is_file()


@pytest.mark.slow
def test_a_written_scenario_resolves_to_itself(scenarios, tmp_path):
    first, second = tmp_path / "first.xosc", tmp_path / "second.xosc"
    for document in scenarios:
        if document.path.name not in NEEDS_ABSENT_ASSETS:
            xosc.write(xosc.resolve(document), first)
            again = xosc.load(first)
            if again.remarks:  # entries of catalogues of a later version have become parts of it
                xosc.write(again, first)
            xosc.write(xosc.resolve(xosc.load(first)), second)
            assert first.read_bytes() == second.read_bytes(), document.path
