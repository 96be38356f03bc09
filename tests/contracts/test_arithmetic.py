"""Machines whose numpy takes other versions of its functions are told apart."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from foretwin.contracts.arithmetic import fingerprints

_SHOW = "import json; from foretwin.contracts.arithmetic import fingerprints as f; " + (
    "print(json.dumps(dict(f())))"
)


def elsewhere(**env: str) -> dict[str, str]:
    done = subprocess.run(
        [sys.executable, "-P", "-c", _SHOW], env=os.environ | env, text=True, check=True,
        capture_output=True,
    )  # fmt: skip
    found: dict[str, str] = json.loads(done.stdout)
    return found


def test_another_process_of_this_machine_comes_to_the_same() -> None:
    assert elsewhere() == dict(fingerprints())
    assert elsewhere(OPENBLAS_NUM_THREADS="1") == dict(fingerprints())
    assert "arctan2 float32" in fingerprints()


def test_a_processor_that_can_less_is_noticed() -> None:
    """Where this one has several versions to choose from."""
    found = np.show_config(mode="dicts")["SIMD Extensions"]["found"]
    if not found:
        pytest.skip("this processor has the least that numpy knows")
    assert elsewhere(NPY_DISABLE_CPU_FEATURES=" ".join(found)) != dict(fingerprints())
