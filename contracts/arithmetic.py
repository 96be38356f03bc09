"""Fingerprints of what numpy computes on this machine, function by function.

numpy has several versions of its functions, and takes the one that the processor is fit for. They
agree in all but the last bit of few results, so that futures show it in one of hundreds alone: two
machines are compared by the functions themselves.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

_VALUES = 1 << 14
_SMALL = 24
"""Rows of a matrix: so small that linear algebra does not spread over threads."""

_OF_ONE: dict[str, Callable[[Any], Any]] = {
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "arctan": np.arctan, "tanh": np.tanh,
    "exp": lambda x: np.exp(0.1 * x), "expm1": lambda x: np.expm1(0.1 * x),
    "log": lambda x: np.log(np.abs(x) + 1e-9), "sqrt": lambda x: np.sqrt(np.abs(x)),
    "arcsin": lambda x: np.arcsin(x / 200.0), "arccos": lambda x: np.arccos(x / 200.0),
    "power": lambda x: np.power(np.abs(x), 0.7), "square": np.square,
    "reciprocal": lambda x: 1.0 / (x + 300.0), "cumsum": np.cumsum,
    "sum": lambda x: x[: _SMALL * _SMALL].reshape(_SMALL, -1).sum(axis=1),
    "std": lambda x: x[: _SMALL * _SMALL].reshape(_SMALL, -1).std(axis=1),
}  # fmt: skip
_OF_TWO: dict[str, Callable[[Any, Any], Any]] = {
    "arctan2": np.arctan2, "hypot": np.hypot, "mod": lambda x, y: np.mod(x, np.abs(y) + 0.1),
}  # fmt: skip
_OF_MATRICES: dict[str, Callable[[Any, Any], Any]] = {
    "matmul": lambda a, b: a @ b,
    "solve": np.linalg.solve,
    "einsum": lambda a, b: np.einsum("ij,kj->ik", a, b),
}


@functools.cache
def fingerprints() -> Mapping[str, str]:
    """Return a short hash of each function's results on fixed values, by its name and type."""
    random = np.random.Generator(np.random.PCG64(20261123))
    found = {}
    x, y = random.uniform(-200.0, 200.0, (2, _VALUES))
    for kind in (np.float64, np.float32):
        one, two = x.astype(kind), y.astype(kind)
        results = {name: function(one) for name, function in _OF_ONE.items()}
        results |= {name: function(one, two) for name, function in _OF_TWO.items()}
        a, b = (v[: _SMALL * _SMALL].reshape(_SMALL, _SMALL) for v in (one, two))
        results |= {name: function(a, b) for name, function in _OF_MATRICES.items()}
        for name, values in results.items():
            data = np.ascontiguousarray(values).tobytes()
            found[f"{name} {np.dtype(kind).name}"] = hashlib.sha256(data).hexdigest()[:12]
    return found


@functools.cache
def arithmetic_sha256() -> str:
    """Return one short hash of all fingerprints: where it is the same, numpy's bits are."""
    whole = "".join(f"{name} {found}\n" for name, found in sorted(fingerprints().items()))
    return hashlib.sha256(whole.encode()).hexdigest()[:12]
