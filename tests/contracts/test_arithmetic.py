"""Machines whose numpy takes other versions of its functions are told apart."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from foretwin.contracts.arithmetic import _OF_MATRICES, _OF_ONE, _OF_TWO, fingerprints

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


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_each_function_is_asked_where_it_has_results_and_many_of_them(kind: type) -> None:
    """What is nowhere, or the same everywhere, would tell no two machines apart."""
    one, two = np.random.default_rng(1).uniform(-200.0, 200.0, (2, 1 << 14)).astype(kind)
    square = one[: 24 * 24].reshape(24, 24)
    results = {name: function(one) for name, function in _OF_ONE.items()}
    results |= {name: function(one, two) for name, function in _OF_TWO.items()}
    results |= {name: function(square, square.T + 1.0) for name, function in _OF_MATRICES.items()}
    for name, found in results.items():
        assert np.isfinite(found).all(), name
        assert found.dtype == kind, name
        assert len(np.unique(found)) > 0.7 * found.size or name == "tanh", name
    assert {results[name].shape for name in ("sum", "std")} == {(24,)}
    assert np.ptp(results["arcsin"]) == pytest.approx(np.pi, abs=0.1), "its whole range"
    assert np.ptp(results["arccos"]) == pytest.approx(np.pi, abs=0.1)
