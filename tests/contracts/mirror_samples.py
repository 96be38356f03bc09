"""A mirror that follows its car exactly, for tests that are about something else."""

from __future__ import annotations

from typing import Any

from foretwin.contracts.simulation import MirrorSample, PlaneState


def mirror_sample(stamp_ns: int, car: PlaneState, **changes: Any) -> MirrorSample:
    """Return a sample without any gap, the twin independent, but for the fields that are given."""
    fields: dict[str, Any] = {
        "world_id": None,
        **dict.fromkeys(("real", "twin", "shadow", "ghost"), car),
        **dict.fromkeys(("gap_m", "gap_along_m", "gap_across_m", "gap_yaw_rad"), 0.0),
        **dict.fromkeys(("gap_speed_mps", "since_reset_s"), 0.0),
        "independent": True,
    }
    return MirrorSample(stamp_ns=stamp_ns, **(fields | changes))
