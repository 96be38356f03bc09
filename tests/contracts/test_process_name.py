"""What `top` calls a process."""

from __future__ import annotations

import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    ("process_id", "called"),
    [("w0", "ft-w0"), ("orchestrator", "ft-orchestrator"), ("ros2-beside123", "ft-ros2-beside1")],
)
def test_a_process_is_called_by_its_id(process_id: str, called: str) -> None:
    script = (
        "import sys\n"
        "from foretwin.contracts.process_name import name_process\n"
        "name_process(sys.argv[1])\n"
        "print(open('/proc/self/comm').read(), end='')"
    )
    words = [sys.executable, "-P", "-c", script, process_id]
    said = subprocess.run(words, capture_output=True, text=True, check=True)
    assert said.stdout == f"{called}\n"
