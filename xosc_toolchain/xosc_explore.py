"""The command `xosc-explore`: a page of this machine on which a scenario's parameters are moved and
its run moves along.

The server listens on 127.0.0.1 alone. Each address begins with a token of this start, and requests
that name another host, or come from pages of others, are refused. What a page may ask for is in
`ExploreSite`: points of the named files, with systems under test that the command offers.
"""

from __future__ import annotations

import hmac
import json
import secrets
import sys
import threading
import webbrowser
from collections.abc import Callable, Mapping
from dataclasses import replace
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import parse_qs, unquote, urlsplit

import typer

from runner.batch.options import FailIf, Param
from runner.judging.settings import RunSettings
from runner.view.explore import Superseded
from schemas.common.errors import ToolchainError, UsageError, describe, exit_codes
from schemas.common.policy import current
from schemas.common.terminal.command_line import (
    Jobs,
    Quiet,
    Verbose,
    Version,
    epilog,
    guarded,
    new_app,
    out_folder,
    protected,
    say,
)
from schemas.common.terminal.options import parameters_of, with_settings
from xosc_toolchain.explore_site import KINDS, ExploreSite

NAME = "xosc-explore"
_EXAMPLES = (
    "xosc-explore cut_in_highway --sut adas",
    "xosc-explore mine.xosc --param Ego_Speed_mps=30 --out edge_cases",
    "xosc-explore results",
)
_EPILOG = exit_codes("ended by Ctrl-C", "")
_HOST = "127.0.0.1"
_MOST_BYTES = 64 * 1024
"""Longest body of a request"""
_PATIENCE = 20.0
"""Time that a connection has to send its request, s"""
_MOST_CONNECTIONS = 32
_STRANGE = (
    "sandbox allow-scripts allow-popups; default-src 'none'; img-src 'self' data:; "
    "script-src 'unsafe-inline'; style-src 'unsafe-inline'"
)
"""Policy of pages that lie in a folder: they may not reach this server's own"""

app = new_app()


@app.command(epilog=epilog(_EPILOG, *_EXAMPLES))
@protected("max_runs")
@with_settings
def xosc_explore(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE|FOLDER...",
            help="A scenario or variation file, or the name of a shipped one; or a batch, search "
            "or catalogue, or several batches.",
        ),
    ],
    settings: RunSettings,
    param: Param = None,
    fail_if: FailIf = None,
    out: Annotated[
        Path | None, out_folder("Folder in which the page saves scenarios and variations.")
    ] = None,
    port: Annotated[
        int, typer.Option(min=0, max=65535, metavar="N", help="Port; 0 for any that is free.")
    ] = 0,
    jobs: Jobs = 2,
    show: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False,
    _verbose: Verbose = False,
    quiet: Quiet = False,
    _version: Version = False,
) -> None:
    """Open a page on which a scenario's parameters are moved, and its run, curves and verdict
    follow; Ctrl-C ends it.

    Folders are shown with a question box, and each of their runs can be explored.
    """
    if current().untrusted:
        told = (
            "plays what a page asks for, until it is ended; play files of strangers by "
            "xosc-run --untrusted"
        )
        raise UsageError(f"{NAME} {told}")
    settings = replace(settings, fail_if=tuple(fail_if or ()))
    site = ExploreSite(paths, settings, parameters_of(param or ()), out, jobs)
    try:
        server = _Server(site, port)
    except OSError as error:
        raise UsageError(
            f"--port {port}: {error.strerror or error}; 0 takes one that is free"
        ) from None
    address = f"http://{_HOST}:{server.server_port}/{server.token}/"
    try:
        say(address)
        if not quiet:
            say("open this address in a browser of this machine; Ctrl-C ends it", to=sys.stderr)
        if show:
            webbrowser.open(address)
        server.serve_forever()
    except KeyboardInterrupt:
        say("", f"{NAME}: ended", to=sys.stderr)
    finally:
        server.server_close()
        site.close()


# the server -------------------------------------------------------------------------------------


class _Server(ThreadingHTTPServer):
    """Serves a site under a token."""

    daemon_threads = True
    allow_reuse_address = False

    def __init__(self, site: ExploreSite, port: int) -> None:
        self.site, self.token = site, secrets.token_urlsafe(24)
        self._free = threading.BoundedSemaphore(_MOST_CONNECTIONS)
        super().__init__((_HOST, port), _Handler)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer in a thread; more connections than there may be are closed."""
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Answer, then leave the place to another connection."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing about connections that others have closed."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Refused(Exception):
    """A request that is refused before its contents are looked at."""

    def __init__(self, status: HTTPStatus, reason: str) -> None:
        super().__init__(reason)
        self.status = status


class _Handler(BaseHTTPRequestHandler):
    """One request."""

    server: _Server
    timeout = _PATIENCE
    server_version, sys_version = "xosc", ""

    def do_GET(self) -> None:
        """Pages."""
        self._guarded(self._page)

    def do_POST(self) -> None:
        """Requests of pages, as JSON."""
        self._guarded(self._request)

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing: the address has the token."""

    def _guarded(self, answer: Callable[[str, dict[str, list[str]]], None]) -> None:
        try:
            try:
                answer(*self._asked())
            except _Refused as error:
                self._send(str(error).encode(), "text/plain; charset=utf-8", error.status)
            except Superseded as error:
                self._json({"error": str(error)}, HTTPStatus.CONFLICT)
            except Exception as error:
                code = HTTPStatus.UNPROCESSABLE_ENTITY
                if not isinstance(error, ToolchainError):
                    code = HTTPStatus.INTERNAL_SERVER_ERROR
                self._json({"error": describe(error)[0]}, code)
        except OSError:
            self.close_connection = True  # the page has gone

    def _asked(self) -> tuple[str, dict[str, list[str]]]:
        """Path below the token, and query.

        Raises:
            _Refused: another host is named, another page asks, or the token is missing.
        """
        port = self.server.server_port
        hosts = [f"{_HOST}:{port}", f"localhost:{port}"]
        if self.headers.get("Host") not in hosts:
            raise _Refused(HTTPStatus.MISDIRECTED_REQUEST, f"this server is {hosts[0]}")
        origin = self.headers.get("Origin")
        if origin is not None and origin.removeprefix("http://") not in hosts:
            raise _Refused(HTTPStatus.FORBIDDEN, "pages of others may not ask")
        address = urlsplit(self.path)
        token, slash, path = address.path.removeprefix("/").partition("/")
        if not (slash and hmac.compare_digest(token.encode(), self.server.token.encode())):
            raise _Refused(HTTPStatus.FORBIDDEN, "the address that the command prints has a token")
        return unquote(path), parse_qs(address.query)

    def _page(self, path: str, query: dict[str, list[str]]) -> None:
        site = self.server.site
        if path == "":
            return self._html(site.start())
        if path == "explore":
            try:
                return self._html(site.explore(query.get("row", [""])[0]))
            except ToolchainError as error:
                raise _Refused(HTTPStatus.UNPROCESSABLE_ENTITY, str(error)) from None
        if path.startswith("page/") and site.folder is not None:
            file = site.folder.file(path.removeprefix("page/"))
            if file is not None:
                kind = KINDS[file.suffix]
                return self._send(file.read_bytes(), kind, policy=_STRANGE)
        raise _Refused(HTTPStatus.NOT_FOUND, "there is no such page")

    def _request(self, path: str, _: dict[str, list[str]]) -> None:
        site = self.server.site
        answers: dict[str, Callable[[Mapping[str, Any]], Any]] = {
            "film": site.film,
            "map": site.map,
            "border": site.border,
            "save": site.save,
            "rows": site.rows,
        }
        asked = self._body()
        if path not in answers:
            raise _Refused(HTTPStatus.NOT_FOUND, "there is no such request")
        answer = answers[path](asked)
        if isinstance(answer, Mapping):
            self._json(answer)
            return
        self._head("application/x-ndjson", HTTPStatus.OK)
        for part in answer:
            self.wfile.write(json.dumps(part).encode() + b"\n")
            self.wfile.flush()

    def _body(self) -> Mapping[str, Any]:
        """The object that is sent.

        Raises:
            _Refused: it is no JSON object, or too long.
        """
        if self.headers.get_content_type() != "application/json":
            raise _Refused(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "JSON is expected")
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal():
            raise _Refused(HTTPStatus.LENGTH_REQUIRED, "the length of the body is expected")
        if int(length) > _MOST_BYTES:
            told = f"at most {_MOST_BYTES} bytes are taken"
            raise _Refused(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, told)
        try:
            found = json.loads(self.rfile.read(int(length)))
        except (ValueError, RecursionError):
            raise _Refused(HTTPStatus.BAD_REQUEST, "this is no JSON") from None
        if not isinstance(found, dict):
            raise _Refused(HTTPStatus.BAD_REQUEST, "a JSON object is expected")
        return found

    def _html(self, text: str) -> None:
        self._send(text.encode("utf-8", "replace"), "text/html; charset=utf-8")

    def _json(self, values: Mapping[str, Any], status: HTTPStatus = HTTPStatus.OK) -> None:
        self._send(json.dumps(values).encode(), "application/json", status)

    def _send(
        self, content: bytes, kind: str, status: HTTPStatus = HTTPStatus.OK, policy: str = ""
    ) -> None:
        self._head(kind, status, {"Content-Length": str(len(content))}, policy)
        self.wfile.write(content)

    def _head(
        self,
        kind: str,
        status: HTTPStatus,
        more: Mapping[str, str] | None = None,
        policy: str = "",
    ) -> None:
        self.send_response(status)
        safe = {
            "Content-Type": kind,
            "Cache-Control": "no-store",
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Content-Security-Policy": policy or "frame-ancestors 'self'",
        }
        for name, value in {**safe, **(more or {})}.items():
            self.send_header(name, value)
        self.end_headers()


def main() -> None:
    """Entry point."""
    guarded(NAME, app)


if __name__ == "__main__":
    main()
