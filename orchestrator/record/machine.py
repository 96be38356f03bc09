"""What of a machine decides the bits that it computes, and in words how two of them differ."""

from __future__ import annotations

import os
import platform
from pathlib import Path

from foretwin.contracts.arithmetic import fingerprints
from foretwin.contracts.fleet import MachineInfo
from foretwin.contracts.versions import versions
from foretwin.orchestrator.processors import processors

_SWITCHES = "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NPY_DISABLE_CPU_FEATURES"
"""What makes numba and numpy take a processor for another one."""


def this_machine(cpuinfo: Path = Path("/proc/cpuinfo")) -> MachineInfo:
    """Return what this machine is."""
    return MachineInfo(
        cores=processors(),
        cpu=_cpu(cpuinfo),
        versions=versions(),
        arithmetic=dict(fingerprints()),
    )


def other_arithmetic(theirs: MachineInfo, ours: MachineInfo) -> tuple[str, ...]:
    """Return the functions of numpy that come to other bits on two machines, by their names."""
    return tuple(
        sorted(
            name for name, found in ours.arithmetic.items() if theirs.arithmetic.get(name) != found
        )
    )


def differences(theirs: MachineInfo, ours: MachineInfo) -> str:
    """Return in words what may make two machines compute other bits."""
    found = [
        f"{name} {theirs.versions.get(name, 'missing')} there, {version} here"
        for name, version in sorted(ours.versions.items())
        if theirs.versions.get(name) != version
    ]
    if theirs.cpu != ours.cpu:
        found.append(f"{theirs.cpu} there, {ours.cpu} here")
    return "; ".join(found) or f"versions and processor ({ours.cpu}) are said to be the same"


def _cpu(cpuinfo: Path) -> str:
    model = platform.processor() or platform.machine()
    try:
        for line in cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines():
            name, _, value = line.partition(":")
            if name.strip() == "model name":
                model = value.strip()
                break
    except OSError:
        pass
    switched = [f"{name}={os.environ[name]}" for name in _SWITCHES if os.environ.get(name)]
    return " ".join([model, *switched])
