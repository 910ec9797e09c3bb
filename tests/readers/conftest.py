"""What packages of others make of our exports, in an environment of their own:
`make readers` makes it and runs these tests.

They pin packages that this project can't have beside it. Each test names a program, which gets
files and answers in JSON.
"""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

PYTHON = "XOSC_READERS_PYTHON"

Read = Callable[..., Any]


@pytest.fixture(scope="session")
def read() -> Read:
    """Runs a program (source text) with arguments in the readers' environment;
    what the last line says that it prints.
    """
    python = os.environ.get(PYTHON)
    if not python:
        pytest.skip(
            f"{PYTHON} names no Python that has the packages of tests/readers/requirements.txt "
            "(see make readers)"
        )

    def run(program: str, *arguments: str | Path) -> Any:
        answer = subprocess.run(
            [python, "-c", program, *map(str, arguments)], capture_output=True, text=True
        )
        assert answer.returncode == 0, answer.stderr[-3000:]
        return json.loads(answer.stdout.splitlines()[-1])

    return run
