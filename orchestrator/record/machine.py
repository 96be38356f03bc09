"""What of a machine decides the bits that it computes, and in words how two of them differ."""

from __future__ import annotations

from foretwin.contracts.arithmetic import fingerprints
from foretwin.contracts.fleet import MachineInfo
from foretwin.contracts.versions import processor, versions
from foretwin.orchestrator.processors import processors


def this_machine() -> MachineInfo:
    """Return what this machine is."""
    return MachineInfo(
        cores=processors(),
        cpu=processor(),
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
