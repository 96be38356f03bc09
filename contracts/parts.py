"""The finished part of a sweep: what who plays a job is told of its cells, and what comes back."""

from __future__ import annotations

import msgspec


class JobCells(msgspec.Struct, frozen=True, kw_only=True):
    """What a sweep's rows say of a job's futures beside what the job says, in their order."""

    first: int
    """The number of the first cell; the others follow it."""
    junction_id: str
    vehicle: str
    """Its name."""
    scenarios: tuple[str, ...]
    cases: tuple[int, ...]
    places: tuple[str, ...]
    attribution: str
    """Whose data the Worlds of the whole sweep are made from."""


class CaseCount(msgspec.Struct, frozen=True, kw_only=True):
    """What came of the cases of one scenario with one planner."""

    scenario: str
    planner: str
    cases: int
    placed: int
    collided: int
    failed: int
    played: int | None = None
    """Placed, and played to their end; None in a part from before that was counted."""
    clearance_m: tuple[float, ...] = ()
    scores: tuple[float, ...] = ()
    reasons: dict[str, int] = {}
    """How often each failure happened."""
    not_placed: dict[str, int] = {}
    """How often each reason kept a case from being played."""


class FinishedPart(msgspec.Struct, frozen=True, kw_only=True):
    """All that a sweep keeps of a job: whole files of Parquet by table, and what they come to."""

    job_sha256: str
    tables: dict[str, bytes]
    rows_sha256: str
    """Of the rows of futures, each as msgpack, in their order."""
    counts: tuple[CaseCount, ...]
    given_up: int = 0
    """Futures that were neither played nor left out for a reason of their own."""
