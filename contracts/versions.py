"""What decides results, for records: the versions of libraries, and the processor."""

from __future__ import annotations

import functools
import importlib.metadata
import os
import platform
from pathlib import Path

_ARITHMETIC = "numpy", "scipy", "shapely", "numba"
_SWITCHES = "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NPY_DISABLE_CPU_FEATURES"
"""What makes numba and numpy take a processor for another one."""
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
def processor(cpuinfo: Path = Path("/proc/cpuinfo")) -> str:
    """Return what this machine computes with, in words: the model, and what is switched off."""
    try:
        told = cpuinfo.read_text(encoding="utf-8", errors="replace")
    except OSError:
        told = ""
    models = (line.split(":", 1)[1] for line in told.splitlines() if line.startswith("model name"))
    named = f"{platform.machine()} {next(models, platform.processor()).strip()}".strip()
    switched = [f"{name}={os.environ[name]}" for name in _SWITCHES if os.environ.get(name)]
    return " ".join([named, *switched])
