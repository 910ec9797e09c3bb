"""Exported scenarios as ASAM's own quality checker reads them
(asam-qc-openscenarioxml): its schemas, its rules.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import xosc
from runner.exchange.exports import TARGETS
from runner.exchange.exports.exporting import export_documents
from tests.readers.conftest import Read
from xosc.exports.draft import Folder

LIBRARY = sorted((Path(xosc.__file__).parent / "library").glob("*.xosc"))

OPERATORS = "asam.net:xosc:1.2.0:data_type.allowed_operators"
"""A rule that version 1.0.0 of the checker applies to files of 1.3 as well, which have more
functions: min, max, sign, abs
"""

READ = """
import json, logging, sys
from qc_baselib import Configuration, Result
from qc_openscenario import constants, main
logging.disable()
found = {}
for path in sys.argv[1:]:
    config, result = Configuration(), Result()
    config.set_config_param("InputFile", path)
    result.register_checker_bundle(name=constants.BUNDLE_NAME, description="", version=constants.BUNDLE_VERSION)
    main.run_checks(config, result)
    (bundle,) = result.get_checker_bundle_results()
    checkers = {checker.checker_id: checker for checker in bundle.checkers}
    assert all(checker.status.value != "error" for checker in checkers.values()), path
    schema = checkers[main.schema_checker.valid_schema.CHECKER_ID].status.value
    issues = [[issue.rule_uid, issue.description] for checker in checkers.values() for issue in checker.issues]
    found[path] = [schema, issues]
print(json.dumps(found))
"""


@pytest.mark.slow
@pytest.mark.parametrize("target", ["1.0", "1.1", "1.2", "1.3", "esmini", "carla"])
def test_the_exported_library_passes_all_checks(target: str, read: Read, tmp_path: Path) -> None:
    exported = [
        done
        for done in export_documents(LIBRARY, TARGETS[target], Folder(tmp_path))
        if done.exit_code == 0
    ]
    files = sorted(tmp_path.rglob("*.xosc"))
    assert exported and len(files) > len(exported) / 2
    found = read(READ, *files)
    issues = [(path, *issue) for path, (_, listed) in found.items() for issue in listed]
    assert [
        each for each in issues if each[1] != OPERATORS or xosc.load(each[0]).version < (1, 3)
    ] == []
    assert {schema for schema, _ in found.values()} == {"completed"}
