"""Turns samples of the mirror into rows of the run's tables."""

from __future__ import annotations

from typing import Any

from foretwin.contracts.simulation import MirrorSample, PlaneState, TwinCorrection

_POSE = ("x_m", "y_m", "yaw_rad", "speed_mps")
_CORRECTION = ("along_mps2", "across_mps2", "yaw_radps2")


def mirror_row(sample: MirrorSample) -> dict[str, Any]:
    """Return the row of one mirror sample; `free_…` where the twin is another than the free one."""
    row: dict[str, Any] = {
        name: getattr(sample, name)
        for name in (
            "stamp_ns", "world_id", "gap_m", "gap_along_m", "gap_across_m", "gap_yaw_rad",
            "gap_speed_mps", "since_reset_s", "independent", "role",
        )
    }  # fmt: skip
    for who in ("real", "twin", "shadow", "ghost", "free"):
        row |= _pose(who, getattr(sample, who))
    return row | _correction(sample.correction)


def mirrored_rows(sample: MirrorSample) -> list[dict[str, Any]]:
    """Return a row for each vehicle beside the car."""
    return [
        {
            "stamp_ns": sample.stamp_ns,
            "vehicle_id": other.vehicle_id,
            "role": other.role,
            **_pose("real", other.real),
            **_pose("shown", other.shown),
            **_correction(other.correction),
        }
        for other in sample.others
    ]


def touch_rows(sample: MirrorSample) -> list[dict[str, Any]]:
    """Return a row for each two that touched since the sample before."""
    return [
        {"stamp_ns": sample.stamp_ns, "one": one, "other": other} for one, other in sample.touches
    ]


def _pose(who: str, pose: PlaneState | None) -> dict[str, float | None]:
    return {f"{who}_{what}": None if pose is None else getattr(pose, what) for what in _POSE}


def _correction(correction: TwinCorrection | None) -> dict[str, float | None]:
    return {
        f"correction_{what}": None if correction is None else getattr(correction, what)
        for what in _CORRECTION
    }
