"""A headless Chromium for judges of the page; see `browser.py`, its other half."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests.contracts.bus_sides import DEADLINE_S

CHROMIUM = Path("/usr/bin/chromium")
HELPER = Path(__file__).with_name("browser.py")


def judges_python() -> Path:
    folder = os.environ.get("JUDGES_VENV")
    if not folder or not CHROMIUM.exists() or shutil.which("tesseract") is None:
        pytest.skip("no JUDGES_VENV, no Chromium, or no tesseract")
    python = Path(folder) / "bin" / "python"
    asked = [str(python), "-c", "import playwright, axe_playwright_python"]
    if subprocess.run(asked, capture_output=True, check=False).returncode:
        pytest.skip("JUDGES_VENV lacks playwright or axe-playwright-python")
    return python


class Browser:
    """A headless Chromium that takes one order a line and answers with one line."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [str(judges_python()), str(HELPER), str(CHROMIUM)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def do(self, what: str, **how: Any) -> Any:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps({"do": what, **how}) + "\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())

    def close(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait(DEADLINE_S)
        self._process.stdout.close()
