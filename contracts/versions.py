"""What decides results, for records: the versions of libraries, and the processor."""

from __future__ import annotations

import functools
import importlib.metadata
import platform
from pathlib import Path

_ARITHMETIC = "numpy", "scipy", "shapely", "numba"
_PACKAGES = ("foretwin", "mujoco", "eclipse-zenoh", "rerun-sdk", "osmium", *_ARITHMETIC)


def versions() -> dict[str, str]:
    """Return the versions of Python and of the libraries that decide results."""
    return dict(_found())


@functools.cache
def _found() -> dict[str, str]:
    """Read them once: the files of nine packages take 5 ms, and a record is told every 2 s."""
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = "not installed as a package"
    return found


@functools.cache
def processor() -> str:
    """Return what this machine computes with, in words."""
    try:
        told = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        told = ""
    models = (line.split(":", 1)[1] for line in told.splitlines() if line.startswith("model name"))
    return f"{platform.machine()} {next(models, platform.processor()).strip()}".strip()
