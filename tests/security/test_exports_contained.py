"""Exports take along what is what it claims, from regular files, and write
nowhere but into their folder.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from schemas.common.errors import InvalidFile, Unsupported
from tests.commands import Answer, Command
from tests.runner.files import ROADS, scenario
from xodr.lookup.geo import without_files
from xosc.exports.references import is_model, need_roads

SECRET = "TOKEN=swordfish"
MODELS = {
    "glb": b"glTF\x02\x00\x00\x00" + bytes(12),
    "gltf": json.dumps({"scenes": [], "asset": {"generator": "x", "version": "2.0"}}).encode(),
    "osgb": bytes.fromhex("a191fb6c1af5eb11") + bytes(20),
    "osgt": b"#Ascii Scene\n#Version 161\n",
    "osg": b"Group {\n  nodeMask 0xffffffff\n}\n",
    "fbx": b"Kaydara FBX Binary  \x00\x1a\x00",
    "fbx as text": b"; FBX 7.3.0 project file\n",
    "obj": (
        b"# town\nmtllib town.mtl\no road\nv 0 0 0\nv 1.0 0 -2e3\nv 0 1 0\nvn 0 0 1\nusemtl "
        b"asphalt\ns off\nf 1//1 2//1 3//1"
    ),
    "3ds": b"MM\x20\x00\x00\x00\x02\x00\x0a\x00",
    "dae": (
        b'<?xml version="1.0"?>\n<!-- by hand -->\n<COLLADA '
        b'xmlns="http://www.collada.org/2005/11/COLLADASchema"/>'
    ),
    "usdc": b"PXR-USDC" + bytes(8),
    "usda": b"#usda 1.0\n(\n)",
}
NO_MODELS = {
    "accounts": b"root:x:0:0:root:/root:/bin/bash\n",
    "environment": b"HOME=/root\x00TOKEN=swordfish\x00",
    "key": b"-----BEGIN OPENSSH PRIVATE KEY-----\n",
    "comments": b"# the password is swordfish\n",
    "comments and a vertex": b"# fine\nv 0 0 0\npassword: swordfish\n",
    "json": b'{"auths": {"asset": "no", "version": "2.0"}}',
    "xml": b"<settings><password>swordfish</password></settings>",
    "none": b"",
    "long": b"v" + b" " * 200_000 + b"x",
}


@pytest.fixture
def contributed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder, and a secret beside it."""
    (tmp_path / "secret.txt").write_text(SECRET)
    folder = tmp_path / "contributed"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


def evil(folder: Path, road: str | None = None, model: str = "") -> Path:
    """A sound scenario that names some road and model."""
    path = scenario(folder, stop=0.2)
    text = path.read_text()
    start, end = text.index("<RoadNetwork>"), text.index("</RoadNetwork>")
    logic = f'<LogicFile filepath="{road}"/>' if road else text[text.index("<LogicFile") : end]
    path.write_text(
        text[:start] + f'<RoadNetwork>{logic}<SceneGraphFile filepath="{model}"/>' + text[end:]
    )
    return path


def exported(command: Command, *more: str, to: str = "1.3") -> Answer:
    return command("xosc-export", "scenario.xosc", "--to", to, "--out", "out", *more)


def copies(folder: Path) -> list[str]:
    """Files of an export whose content is none of its own."""
    return [
        path.name
        for path in folder.glob("out/**/*")
        if path.is_file() and path.suffix not in (".xosc", ".xodr")
    ]


@pytest.mark.parametrize("target", ["1.0", "1.3", "esmini", "carla"])
@pytest.mark.parametrize(
    "road",
    [
        "/proc/self/environ",
        "/etc/passwd",
        "../secret.txt",
        "no_road.xodr",
        "empty.xodr",
        "scenario.xosc",
        "link.xodr",
        "pipe",
    ],
)
def test_a_road_network_is_one(contributed: Path, command: Command, road: str, target: str) -> None:
    (contributed / "no_road.xodr").write_text("<evil/>")
    (contributed / "empty.xodr").write_text(
        '<OpenDRIVE><header revMajor="1" revMinor="4"/></OpenDRIVE>'
    )
    (contributed / "link.xodr").symlink_to("../secret.txt")
    os.mkfifo(contributed / "pipe")
    evil(contributed, road)
    answer = exported(command, to=target)
    assert answer.code == 3, answer
    assert answer.err.count("\n") == 1 and "scenario.xosc" in answer.err
    assert SECRET not in answer.err
    assert not (contributed / "out").exists()


@pytest.mark.parametrize(
    "model", ["/proc/self/environ", "/etc/passwd", "../secret.txt", "model.osgb"]
)
def test_a_model_that_is_none_is_not_taken_along(
    contributed: Path, command: Command, model: str
) -> None:
    (contributed / "model.osgb").symlink_to("../secret.txt")
    evil(contributed, model=model)
    answer = exported(command)
    assert (answer.code, copies(contributed)) == (0, [])
    assert "is no 3-D model of a known format" in answer.out
    assert (
        f'SceneGraphFile filepath="{model}"' in (contributed / "out" / "scenario.xosc").read_text()
    )
    assert exported(command, "--strict", "--out", "strict").code == 3


@pytest.mark.parametrize("content", MODELS.values(), ids=MODELS)
def test_models_are_known_by_their_content(content: bytes) -> None:
    assert is_model(content)


@pytest.mark.parametrize("content", NO_MODELS.values(), ids=NO_MODELS)
def test_other_files_are_no_models(content: bytes) -> None:
    assert not is_model(content)


def test_references_to_neighbouring_folders_go_on_working(
    contributed: Path, command: Command
) -> None:
    (contributed / "xodr").mkdir()
    (contributed / "scenarios").mkdir()
    (contributed / "xodr" / "road.xodr").write_bytes((ROADS / "straight.xodr").read_bytes())
    (contributed / "xodr" / "town.glb").write_bytes(MODELS["glb"])
    evil(contributed / "scenarios", "../xodr/road.xodr", "../xodr/town.glb")
    answer = command(
        "xosc-export", "scenarios/scenario.xosc", "--to", "1.3", "--out", "out", "--untrusted"
    )
    assert (answer.code, "lies outside" in answer.out) == (0, False), answer.err
    assert copies(contributed) == ["town.glb"]
    named = command("xosc-export", "scenarios", "--to", "1.3", "--out", "two")
    assert (named.code, named.out.count("lies outside of")) == (0, 2), named
    refused = command("xosc-export", "scenarios", "--to", "1.3", "--out", "three", "--untrusted")
    assert (refused.code, refused.err.count("\n")) == (3, 1)
    assert "lies outside of" in refused.err and "--untrusted refuses" in refused.err


def test_nothing_is_written_through_a_link(contributed: Path, command: Command) -> None:
    (contributed.parent / "elsewhere").mkdir()
    (contributed / "out").mkdir()
    (contributed / "out" / "roads").symlink_to("../../elsewhere")
    evil(contributed)
    answer = exported(command)
    assert (answer.code, list((contributed.parent / "elsewhere").iterdir())) == (2, [])
    assert "a symbolic link leads out of the output folder" in answer.err


def test_a_replay_replaces_a_link_of_its_name(contributed: Path, command: Command) -> None:
    (contributed / "scenario.html").symlink_to("../secret.txt")
    evil(contributed)
    assert command("xosc-run", "scenario.xosc", "--replay", "--world", "kinematic").code == 0
    assert (contributed.parent / "secret.txt").read_text() == SECRET
    assert not (contributed / "scenario.html").is_symlink()


# projections -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "projection",
    [
        "+proj=longlat +nadgrids=/etc/passwd",
        "+proj=tmerc +lat_0=0 +nadgrids=./grid.gsb +no_defs",
        "+init=/etc/passwd:x",
        "init=./file:x",
        "+proj=pipeline +step +proj=hgridshift +grids=/etc/passwd",
        "+proj=vgridshift +grids=x",
        "+proj=defmodel +model=/etc/passwd",
        'BOUNDCRS[SOURCECRS[x],ABRIDGEDTRANSFORMATION["x",METHOD["x"],PARAMETERFILE["x","/etc/passwd"]]]',
        'PROJCS["x",EXTENSION["PROJ4","+proj=merc +nadgrids=/etc/passwd"]]',
        '{"type": "BoundCRS", "transformation": {"parameters": [{"name": "Latitude shift file"}]}}',
    ],
)
def test_a_projection_reads_no_file(projection: str) -> None:
    with pytest.raises(
        Unsupported, match=r"^road.xodr: geoReference: the geoReference reads files"
    ):
        without_files(projection, Path("road.xodr"))


@pytest.mark.parametrize(
    ("projection", "read"),
    [
        ("+proj=utm +zone=32 +datum=WGS84", "+proj=utm +zone=32 +datum=WGS84"),
        (
            "+proj=tmerc +lat_0=4.9e1 +geoidgrids=/etc/passwd +vunits=m +no_defs",
            "+proj=tmerc +lat_0=4.9e1 +no_defs",
        ),
        ("+proj=merc +a=6378137 +nadgrids=@null +no_defs", "+proj=merc +a=6378137 +no_defs"),
        ("+init=epsg:25832 +no_defs", "EPSG:25832"),
        ("EPSG:25832", "EPSG:25832"),
    ],
)
def test_projections_without_files_are_read(projection: str, read: str) -> None:
    assert without_files(projection, Path("road.xodr")) == read


def test_roads_of_a_repaired_file_are_roads() -> None:
    content = (ROADS / "straight.xodr").read_bytes()
    assert need_roads(content, Path("road.xodr")) == []
    assert need_roads(content.replace(b"<?xml", b"\n<?xml", 1), Path("road.xodr"))
    with pytest.raises(InvalidFile, match="OpenDRIVE file is expected"):
        need_roads(
            b'<OpenSCENARIO><FileHeader revMajor="1" revMinor="3"/></OpenSCENARIO>', Path("x")
        )
