"""What a job and its futures are called wherever they are recorded: hashes of what they say."""

from __future__ import annotations

import hashlib
from typing import NamedTuple

from foretwin.contracts.codec import content_bytes, decode_content
from foretwin.contracts.futures import Job
from foretwin.contracts.vehicle import VehicleParameters

_ID_LETTERS = 12


class JobBytes(NamedTuple):
    """A job's canonical bytes, equal for equal jobs, and their SHA-256: the job's name."""

    data: bytes
    sha256: str


def job_bytes(job: Job) -> JobBytes:
    """Return the canonical bytes of a job."""
    data = content_bytes(job)
    return JobBytes(data, hashlib.sha256(data).hexdigest())


def job_from_bytes(data: bytes, *, where: str) -> Job:
    """Return the job of `job_bytes`; raises SchemaMismatch, naming `where`, for anything else."""
    return decode_content(data, Job, where=where)


def future_id(job_sha256: str, index: int) -> str:
    """Return the id of a job's future by its index; the same job gives the same ids for ever."""
    return f"{job_sha256[:_ID_LETTERS]}-{index}"


def vehicle_digest(vehicle: VehicleParameters) -> str:
    """Return a short hash of a vehicle's parameters."""
    return hashlib.sha256(content_bytes(vehicle)).hexdigest()[:_ID_LETTERS]
