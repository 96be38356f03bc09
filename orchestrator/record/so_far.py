"""What run.json would say now, kept on the disk while a drive goes on, for one that is killed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from foretwin.orchestrator.record.durable import WRITING, whole_file

SO_FAR = "so_far.json"
"""In a run's folder; gone once run.json is complete."""


class SoFar(msgspec.Struct, frozen=True, kw_only=True):
    """The record of a drive that goes on, and what of its telemetry was heard, by channel.

    A round that is open has not ended in any way: the ledger need not balance.
    """

    record: dict[str, Any]
    heard: dict[str, int]


def so_far_bytes(record: dict[str, Any], heard: Mapping[str, int]) -> bytes:
    """Return what `write_so_far` writes."""
    return msgspec.json.encode(SoFar(record=record, heard=dict(heard)))


def write_so_far(run: Path, data: bytes) -> None:
    """Write it in place of what was there, complete or not at all; raises OSError."""
    with whole_file(run / SO_FAR) as partial:
        partial.write_bytes(data)


def read_so_far(run: Path) -> SoFar | None:
    """Return what was kept last, None where there is nothing that can be read."""
    try:
        return msgspec.json.decode((run / SO_FAR).read_bytes(), type=SoFar)
    except (OSError, msgspec.DecodeError):
        return None


def forget_so_far(run: Path) -> None:
    """Remove it, and what a kill left of a new one; raises OSError."""
    for name in (SO_FAR, SO_FAR + WRITING):
        (run / name).unlink(missing_ok=True)
