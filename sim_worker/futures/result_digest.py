"""What a job came to, in one number: equal for whoever computed it."""

from __future__ import annotations

import hashlib

import numpy as np

from foretwin.contracts.codec import content_bytes
from foretwin.contracts.futures import FuturesResult


def result_digest(result: FuturesResult) -> str:
    """Return the SHA-256 of everything in a result that does not depend on who computed it."""
    parts = (result.trajectory, result.outcome, result.road_users, *result.accidents)
    digest = hashlib.sha256(
        f"{result.round_id} {result.job_index} {result.world_id} {result.future_indices}".encode()
    )
    for part in parts:
        digest.update(content_bytes(part))
    for name, values in sorted(result.metrics.items()):
        digest.update(name.encode() + np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()
