"""The server of `xosc explore`: refusals, pages, films, maps, borders, saved
files; its pages in Chromium.
"""

from __future__ import annotations

import http.client
import json
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from runner.judging.execution import run
from runner.judging.settings import RunSettings
from tests.commands import Command, as_of_a_terminal
from tests.runner.chromium import Browser
from xosc_toolchain import xosc_explore
from xosc_toolchain.explore_site import ExploreSite

ROOT = Path(__file__).parents[2]
LIBRARY = ROOT / "xosc" / "library"
SETTINGS = RunSettings(sut="adas", world="kinematic", max_time=8.0)


class Served:
    """A server on a thread, and requests to it."""

    def __init__(self, site: ExploreSite) -> None:
        self.server = xosc_explore._Server(site, 0)
        self.host = f"127.0.0.1:{self.server.server_port}"
        self.address = f"http://{self.host}/{self.server.token}/"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def get(self, path: str = "", **headers: str) -> tuple[int, str]:
        return self.ask("GET", f"/{self.server.token}/{path}", None, headers)

    def post(self, path: str, values: Any = None, **headers: str) -> tuple[int, Any]:
        sent = {"Content-Type": "application/json", **headers}
        status, text = self.ask(
            "POST", f"/{self.server.token}/{path}", json.dumps(values or {}), sent
        )
        lines = [json.loads(line) for line in text.splitlines()] if text[:1] == "{" else text
        return status, lines[0] if len(lines) == 1 else lines

    def ask(
        self, method: str, path: str, body: str | None, headers: dict[str, str]
    ) -> tuple[int, str]:
        connection = http.client.HTTPConnection(self.host, timeout=60)
        connection.request(method, path, body, headers)
        answer = connection.getresponse()
        self.headers = dict(answer.getheaders())
        text = answer.read().decode()
        connection.close()
        return answer.status, text


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    out = tmp_path_factory.mktemp("saved")
    site = ExploreSite([LIBRARY / "simple_cut_in.xosc"], SETTINGS, {}, out, 2)
    found = Served(site)
    yield found
    found.server.shutdown()
    found.server.server_close()
    site.close()


# what is refused --------------------------------------------------------------------------------


def test_a_page_is_shown_with_the_token_only(served: Served) -> None:
    status, text = served.get()
    assert status == 200 and "simple_cut_in" in text and "connect-src 'self'" in text
    assert served.headers["Referrer-Policy"] == "no-referrer"
    assert served.headers["Cache-Control"] == "no-store"
    for path in (
        "/",
        "/x/",
        f"/{served.server.token}",
        f"/{served.server.token[:-1]}/",
        "/%C3%A9/",
    ):
        status, text = served.ask("GET", path, None, {})
        assert status == 403 and served.server.token not in text


def test_other_hosts_and_pages_of_others_are_refused(served: Served) -> None:
    port = served.server.server_port
    assert served.get(Host=f"localhost:{port}")[0] == 200
    for host in ("example.org", f"evil.example:{port}", "127.0.0.1", ""):
        assert served.get(Host=host)[0] == 421
    for origin in ("https://example.org", "null", f"http://127.0.0.1:{port + 1}"):
        assert served.post("film", {"parameters": {}}, Origin=origin)[0] == 403
    assert "Access-Control-Allow-Origin" not in served.headers


def test_it_listens_on_this_machine_only(served: Served) -> None:
    assert served.server.socket.getsockname()[0] == "127.0.0.1"


def test_bodies_are_short_json_objects(served: Served) -> None:
    own = f"/{served.server.token}/film"
    typed = {"Content-Type": "application/json"}
    assert served.ask("POST", own, "{}", {"Content-Type": "text/plain"})[0] == 415
    assert served.ask("POST", own, "{", typed)[0] == 400
    assert served.ask("POST", own, "[1]", typed)[0] == 400
    assert served.ask("POST", own, "[" * 60000, typed)[0] == 400
    assert served.ask("POST", own, None, {**typed, "Content-Length": "99999999"})[0] == 413
    assert served.ask("POST", own, None, {**typed, "Content-Length": "-1"})[0] == 411
    assert served.post("nothing")[0] == 404
    assert served.ask("PUT", own, "{}", typed)[0] == 501


@pytest.mark.parametrize(
    ("what", "asked", "told"),
    [
        ("film", {"systems": ["adas"]}, "values of parameters"),
        ("film", {"parameters": {"Gap": "1"}, "systems": ["adas"]}, "no parameter 'Gap'"),
        ("film", {"parameters": {}, "systems": []}, "one system"),
        ("film", {"parameters": {}, "systems": ["os:system"]}, "not offered"),
        ("film", {"parameters": {}, "systems": ["a.py:A"]}, "not offered"),
        ("film", {"row": "7", "parameters": {}, "systems": ["adas"]}, "no row"),
        ("map", {"parameters": {}, "system": "adas", "x": "CutIn_Gap_m", "y": "CutIn_Gap_m"},
            "two different"),
        ("map", {"parameters": {}, "system": "adas", "x": "CutIn_Gap_m", "y": "Ego_Speed_mps",
            "columns": 1000, "rows": 2}, "25 columns"),
        ("border", {"parameters": {}, "system": "adas", "parameter": "Gap"}, "no parameter"),
        ("rows", {"where": "state = 'failed'"}, "folders"),
        ("save", {"parameters": {}, "name": "../out", "kind": "scenario"}, "no name"),
        ("save", {"parameters": {}, "name": "", "kind": "scenario"}, "no name"),
        ("save", {"parameters": {}, "name": "v", "kind": "variation"}, "map"),
        ("save", {"parameters": {}, "name": "v", "kind": "variation",
            "varied": {"CutIn_Gap_m": "7"}}, "values of CutIn_Gap_m"),
    ],
)  # fmt: skip
def test_requests_that_make_no_sense_say_why(
    served: Served, what: str, asked: dict[str, Any], told: str
) -> None:
    status, answer = served.post(what, asked)
    assert status == 422 and told in answer["error"]


def test_a_point_is_saved_as_a_scenario_that_plays_and_a_map_as_a_variation(
    served: Served,
) -> None:
    point = {"CutIn_Gap_m": "12"}
    status, answer = served.post("save", {"parameters": point, "name": "mine", "kind": "scenario"})
    assert status == 200
    result = run(answer["files"][0], SETTINGS)
    assert (
        result.recording.network is not None
        and 'value="12"' in Path(answer["files"][0]).read_text()
    )
    again = served.post("save", {"parameters": point, "name": "mine", "kind": "scenario"})
    assert again[0] == 422 and "already" in again[1]["error"]
    varied = {"CutIn_Gap_m": ["5", "9"], "Ego_Speed_mps": ["20", "22", "24"]}
    asked = {"parameters": point, "name": "grid", "kind": "variation", "varied": varied}
    _, answer = served.post("save", asked)
    from xosc.distributions import variations

    sets = [values for _, values in variations(answer["files"][0])]
    assert len(sets) == 6 and sets[-1] == {"CutIn_Gap_m": "9", "Ego_Speed_mps": "24"}


def test_untrusted_files_a_taken_port_and_other_files_are_refused(
    command: Command, tmp_path: Path
) -> None:
    assert "plays what a page asks for" in refused(command, 2, "simple_cut_in", "--untrusted")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        assert f"--port {port}" in refused(command, 2, "simple_cut_in", "--port", port)
    wrong = tmp_path / "wrong.xosc"
    wrong.write_text("<x")
    assert "wrong.xosc:1" in refused(command, 3, str(wrong))
    assert "expected" in refused(command, 2, str(tmp_path))
    assert "no parameter" in refused(command, 2, "simple_cut_in", "--param", "Gap=1")


def refused(command: Command, code: int, *arguments: str) -> str:
    answer = command("xosc-explore", *arguments)
    assert answer.code == code and answer.out == ""
    return answer.err


# folders ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def batch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from runner.batch.batch import run_batch
    from runner.batch.jobs import jobs_of
    from runner.view.report import write_report

    out = tmp_path_factory.mktemp("batches") / "batch"
    jobs = jobs_of([LIBRARY / "simple_cut_in.xosc"], {"CutIn_Gap_m": "9"}, True)
    list(run_batch(jobs, RunSettings(sut="cas", world="kinematic", max_time=8.0), out=out))
    write_report(out)
    (out.parent / "secret.html").write_text("secret")
    (out / "leads_out.html").symlink_to(out.parent / "secret.html")
    return out


@pytest.fixture(scope="module")
def shelf(batch: Path) -> Iterator[Served]:
    site = ExploreSite([batch], SETTINGS, {}, None, 1)
    found = Served(site)
    yield found
    found.server.shutdown()
    found.server.server_close()
    site.close()


def test_a_batch_is_listed_asked_and_its_runs_are_explored(shelf: Served) -> None:
    status, text = shelf.get()
    assert status == 200 and "page/report.html" in text
    status, answer = shelf.post("rows", {"where": "CutIn_Gap_m < 10"})
    assert status == 200 and answer["count"] == 1 and "simple_cut_in" in answer["rows"][0]
    assert shelf.post("rows", {"where": "CutIn_Gap_m > 10"})[1]["count"] == 0
    hint = shelf.post("rows", {"where": "state = 'pasd'"})[1]["hint"]
    assert hint.startswith("no row has state 'pasd'; ")
    assert "no such column" in shelf.post("rows", {"where": "gap < 1"})[1]["error"]
    status, text = shelf.get(f"explore?row={answer['rows'][0][0]}")
    assert status == 200 and '"value":"9"' in text and '"system":"cas"' in text
    for row in ("7", "-1", "x", ""):
        assert shelf.get(f"explore?row={row}")[0] == 422


def test_pages_of_a_folder_are_served_without_rights_and_nothing_else_is(shelf: Served) -> None:
    assert shelf.get("page/report.html")[0] == 200
    assert "sandbox" in shelf.headers["Content-Security-Policy"]
    for path in ("page/../secret.html", "page/%2e%2e/secret.html", "page/leads_out.html",
        "page//etc/passwd",
                 "page/journal.jsonl", "page/", "page/nothing.html", "page/%00.html"):  # fmt: skip
        status, text = shelf.get(path)
        assert status == 404 and "secret" not in text


def test_a_run_whose_scenario_has_gone_says_so(batch: Path, tmp_path: Path) -> None:
    import shutil

    moved = tmp_path / "batch"
    shutil.copytree(batch, moved, symlinks=True)
    journal = next(path for path in moved.iterdir() if path.suffix == ".jsonl")
    journal.write_text(journal.read_text().replace(str(LIBRARY), "/nowhere"))
    site = ExploreSite([moved], SETTINGS, {}, None, 1)
    with pytest.raises(xosc_explore.ToolchainError):
        site.explore("0")
    site.close()


def test_a_search_without_edge_cases_is_explored_with_its_system_and_pins(
    tmp_path: Path, command: Command
) -> None:
    searching = ("--density", "uniform", "--budget", "4", "--world", "kinematic", "--sut", "adas",
                 "--method", "draws", "--jobs", "1")  # fmt: skip
    found = tmp_path / "found"
    pin = ("--pin", "CutIn_LaneChangeTime_s=4.5", "--pin", "CutIn_Gap_m=39")
    command("xosc-generate", LIBRARY / "simple_cut_in.xosc", *searching, *pin, "--out", found)
    (found / "simple_cut_in.xosc").unlink(missing_ok=True)  # as of a search without edge cases
    site = ExploreSite([found], SETTINGS, {}, None, 1)
    assert site.folder is not None and site.folder.rows("")["count"] > 0
    scenario, values, system = site.folder.target("0")
    assert scenario == LIBRARY / "simple_cut_in.xosc" and system == "adas"
    assert values["CutIn_LaneChangeTime_s"] == "4.5" and "Ego_Speed_mps" in values
    assert '"value":"4.5"' in site.explore("0")
    site.close()


# films, maps, borders, and the page -------------------------------------------------------------


@pytest.mark.slow
def test_films_maps_and_borders(served: Served) -> None:
    asked = {"parameters": {"CutIn_Gap_m": "6"}, "systems": ["adas", "cas"], "ground": ""}
    status, answer = served.post("film", asked)
    assert status == 200 and [each["sut"] for each in answer["scene"]["runs"]] == ["adas", "cas"]
    assert (
        "violates"
        in served.post("film", {"parameters": {"CutIn_Gap_m": "-5"}, "systems": ["adas"]})[1][
            "error"
        ]
    )
    grid = {
        "parameters": {},
        "system": "cas",
        "x": "CutIn_Gap_m",
        "y": "Ego_Speed_mps",
        "columns": 3,
        "rows": 2,
    }
    status, lines = served.post("map", grid)
    assert status == 200 and lines[-1] == {"done": True} and len(lines[0]["x"]) == 3
    assert sorted(tuple(line["cell"]) for line in lines[1:-1]) == [
        (i, j) for i in range(3) for j in range(2)
    ]
    direct = {"CutIn_Gap_m": lines[0]["x"][0], "Ego_Speed_mps": lines[0]["y"][1]}
    settings = RunSettings(sut="cas", world="kinematic", max_time=8.0)
    (state,) = (line["state"] for line in lines[1:-1] if line["cell"] == [0, 1])
    assert state == run(LIBRARY / "simple_cut_in.xosc", settings, parameters=direct).verdict.outcome
    status, answer = served.post(
        "border", {"parameters": {}, "system": "cas", "parameter": "Ego_Speed_mps"}
    )
    assert status == 200 and len(answer["points"]) > 8


@pytest.mark.slow
def test_the_page_plays_maps_and_saves_by_keyboard_and_on_a_phone(
    served: Served, tmp_path: Path
) -> None:
    with Browser(tmp_path / "profile") as browser:
        browser.open(served.address, width=1400)
        wait(browser, "document.querySelector('.status .badge')")
        assert browser.unnamed() == []
        before = browser.run("document.querySelector('.knob input[type=text]').value")
        browser.run("document.querySelector('.knob input[type=range]').focus()")
        browser.press("ArrowRight")
        assert browser.run("document.querySelector('.knob input[type=text]').value") != before
        assert browser.run("document.activeElement.type") == "range", "a new run keeps the focus"
        browser.run("window.first = document.querySelector('.stage canvas')")
        choose(browser, "Compare with", "cas")
        wait(browser, "document.querySelectorAll('.status .badge').length === 2")
        assert browser.run("document.querySelectorAll('.stage').length") == 2
        choose(browser, "Compare with", "")
        wait(browser, "document.querySelectorAll('.status .badge').length === 1")
        box = "document.querySelector('.knob input[type=text]')"
        browser.run(f"{box}.value = '-7'; {box}.dispatchEvent(new Event('change'))")
        wait(browser, "document.querySelector('.fault').textContent")
        assert "violates" in browser.text(".fault")
        click(browser, "Reset")
        wait(browser, "!document.querySelector('.fault').textContent")
        click(browser, "Draw the map")
        wait(
            browser,
            "document.querySelectorAll('.cells :is(.passed, .failed, .inconclusive, "
            ".error)').length === 117",
        )
        browser.run("document.querySelector('.cells .here').focus()")
        browser.press("ArrowUp")
        assert browser.run("document.activeElement.getAttribute('role')") == "gridcell"
        told = browser.run("document.activeElement.getAttribute('aria-label')")
        browser.run("document.activeElement.click()")
        wait(browser, "document.activeElement.classList.contains('here')")
        assert told.split(" ")[1].rstrip(",") == browser.run(
            "document.querySelector('.knob input[type=text]').value"
        )
        browser.run("document.querySelector('#save-name').value = 'from_page'")
        click(browser, "Scenario")
        wait(browser, "document.querySelector('.saved').textContent.includes('from_page.xosc')")
        browser.open(served.address, width=390, height=844)
        wait(browser, "document.querySelector('.status .badge')")
        assert browser.run("document.documentElement.scrollWidth") == 390
        browser.run("document.querySelectorAll('.knob')[3].scrollIntoView()")
        seen = "document.querySelector('.stage').getBoundingClientRect().bottom"
        assert 0 < browser.run(seen) < 400, "the film stays in sight"
        own = [each for each in browser.requests if not each.startswith((served.address, "about:"))]
        assert own == [] and [each for each in browser.errors if "422" not in each] == []


@pytest.mark.slow
def test_a_folder_is_asked_and_explored_on_its_page(shelf: Served, tmp_path: Path) -> None:
    with Browser(tmp_path / "profile") as browser:
        browser.open(shelf.address, width=390, height=844)
        assert (
            browser.unnamed() == [] and browser.run("document.documentElement.scrollWidth") == 390
        )
        browser.run("document.querySelector('[type=search]').value = \"state = 'nothing'\"")
        click(browser, "Ask")
        wait(browser, "document.querySelectorAll('tbody tr').length === 0")
        browser.open(shelf.address)
        browser.open(browser.run("document.querySelector('tbody a').href"))
        wait(browser, "document.querySelector('.status .badge')")
        assert browser.errors == []


def wait(browser: Browser, condition: str) -> None:
    """Wait until an expression is true."""
    ask = f"const ask = () => {condition} ? done(true) : setTimeout(ask, 20); ask();"
    script = f"new Promise(done => {{ {ask} setTimeout(() => done(false), 30000) }})"
    assert browser.run(script), condition


def click(browser: Browser, text: str) -> None:
    browser.run(
        "[...document.querySelectorAll('button')].find(each => each.textContent === "
        f"{json.dumps(text)}).click()"
    )


def choose(browser: Browser, label: str, value: str) -> None:
    found = f"document.querySelector('select[aria-label={json.dumps(label)}]')"
    browser.run(f"{found}.value = {json.dumps(value)}; {found}.dispatchEvent(new Event('change'))")


@pytest.mark.slow
def test_ctrl_c_ends_the_command(tmp_path: Path) -> None:
    program = [sys.executable, "-m", "xosc_toolchain.xosc_explore", "simple_cut_in"]
    with subprocess.Popen(
        program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)}, preexec_fn=as_of_a_terminal,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        try:
            address = process.stdout.readline().strip()
            assert address.startswith("http://127.0.0.1:")
            process.send_signal(signal.SIGINT)
            assert process.wait(20) == 0
        finally:
            process.kill()  # leaving the block waits for it
