"""OpenLABEL files as vcd reads them, whose schema is ASAM's."""

from __future__ import annotations

from pathlib import Path

import runner
import xodr
from runner.exchange.exports import openlabel
from tests.readers.conftest import Read
from tests.runner.files import car, place, scenario
from xosc.exports.draft import Folder
from xosc.writing.tags import ASAM, Tag, to_bytes

LIBRARY = Path(xodr.__file__).parent / "library"

READ = """
import json, sys, types
import jsonschema
sys.modules["cv2"] = types.ModuleType("cv2")  # for drawing, and not installed
from vcd import core, schema
found = []
for path in sys.argv[1:]:
    jsonschema.validate(json.load(open(path, encoding="utf-8")), schema.openlabel_schema)
    labels = core.OpenLABEL()
    labels.load_from_file(path, validation=True)
    content = labels.data["openlabel"]
    tags = sorted(tag["type"] for tag in content["tags"].values())
    found.append([tags, [labels.get_object(uid)["name"] for uid in content.get("objects", {})]])
print(json.dumps(found))
"""


def test_labels_of_a_run_are_valid_and_name_everyone(read: Read, tmp_path: Path) -> None:
    path = scenario(
        tmp_path,
        road="curve",
        entities=[car("Ego"), car("Ö")],
        init=place("Ego", 20, 10) + place("Ö", 150, 9, lane=1),
    )
    tags = [Tag("RoadUserCar", None, ASAM), Tag("scenarioClass", "cut in"), Tag("metric", 1.5)]
    path.with_name("scenario.openlabel.json").write_bytes(to_bytes(tags, path.name, "tests"))
    openlabel.export(
        runner.run(path, world="kinematic", timestep=0.1, sut="none"),
        "run",
        Folder(tmp_path / "out"),
    )
    (told,) = read(READ, tmp_path / "out" / "run.openlabel.json")
    assert told == [sorted(tag.type for tag in tags), ["Ego", "Ö"]]


def test_tags_of_the_maps_are_valid(read: Read) -> None:
    files = sorted(LIBRARY.glob("*.openlabel.json"))
    assert files and all(tags and not objects for tags, objects in read(READ, *files))
