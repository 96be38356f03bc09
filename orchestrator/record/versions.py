"""The versions of what decides results, for records."""

from __future__ import annotations

import importlib.metadata
import platform

_ARITHMETIC = "numpy", "scipy", "shapely", "numba"
_PACKAGES = ("foretwin", "mujoco", "eclipse-zenoh", "rerun-sdk", "osmium", *_ARITHMETIC)


def versions() -> dict[str, str]:
    """Return the versions of Python and of the libraries that decide results."""
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = "not installed as a package"
    return found
