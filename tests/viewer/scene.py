"""A 20 s drive across the drawn junction, as messages."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import DriveEnd, GnssFix, PlannedTrajectory, VehicleState
from foretwin.contracts.frames import (
    GeoPoint,
    LocalFrame,
    geo_from_local,
    geo_from_local_yaw,
    target_from_source,
)
from foretwin.contracts.simulation import (
    ActiveWorld,
    Comparison,
    Event,
    HorizonError,
    MirrorSample,
    PlanComparison,
    PlaneState,
    Progress,
    RoundView,
    WorkerStatus,
    WorldNotice,
)
from tests.viewer.drawn_junction import LANE_M, WORLD_FRAME, WORLD_ID, junction

__all__ = ["WORLD_FRAME", "WORLD_ID", "junction"]

START_NS = 1_700_000_000_000_000_000
DURATION_S = 20.0
DRIVE_FRAME = LocalFrame(GeoPoint(52.5140, 13.3900))
SPEED_MPS = 8.0


class Message(NamedTuple):
    """One message on its channel."""

    channel: str
    message: Any


def real_at(time_s: float) -> tuple[Array, float]:
    """Return the real car's position in the junction's frame and its yaw."""
    return np.array([-85.0 + SPEED_MPS * time_s, -LANE_M / 2.0]), 0.0


def _in_drive(xy_m: Array, yaw_rad: float) -> tuple[Array, float]:
    moved = target_from_source(
        DRIVE_FRAME,
        WORLD_FRAME,
        xy_m.reshape(-1, 2),
        np.full(xy_m.reshape(-1, 2).shape[0], yaw_rad),
    )
    return moved.xy_m.reshape(xy_m.shape), float(moved.yaw_rad[0])


def _plane(time_s: float, behind_m: float, left_m: float) -> PlaneState:
    here, yaw = real_at(time_s)
    xy, drive_yaw = _in_drive(here + np.array([-behind_m, left_m]), yaw)
    return PlaneState(float(xy[0]), float(xy[1]), drive_yaw, SPEED_MPS - 0.3 * behind_m)


def state_at(time_s: float) -> VehicleState:
    """Return the real car's state, geographic as on the bus."""
    here, yaw = real_at(time_s)
    lat_deg, lon_deg = geo_from_local(WORLD_FRAME, here)
    return VehicleState(
        vehicle_id="car",
        stamp_ns=START_NS + round(time_s * 1e9),
        position=GeoPoint(float(lat_deg), float(lon_deg)),
        yaw_rad=float(geo_from_local_yaw(WORLD_FRAME, yaw, here)),
        speed_mps=SPEED_MPS,
        yaw_rate_radps=0.0,
        accel_mps2=0.0,
    )


def mirror_at(time_s: float) -> MirrorSample:
    """Return twin, shadow and ghost: the twin's gap grows and is reset every 8 s."""
    since = time_s % 8.0
    gap = 0.015 * since**2
    return MirrorSample(
        stamp_ns=START_NS + round(time_s * 1e9),
        world_id=WORLD_ID,
        real=_plane(time_s, 0.0, 0.0),
        twin=_plane(time_s, gap, 0.3 * gap),
        shadow=_plane(time_s, 0.0005, 0.0),
        ghost=_plane(time_s, 0.0005, 0.0),
        gap_m=float(np.hypot(gap, 0.3 * gap)),
        gap_along_m=-gap,
        gap_across_m=0.3 * gap,
        gap_yaw_rad=0.02 * np.sin(since),
        gap_speed_mps=-0.3 * gap,
        since_reset_s=since,
        independent=True,
    )


def round_at(time_s: float, *, futures: int = 64, points: int = 81) -> RoundView:
    """Return futures that fan out at the junction, the nominal one straight on."""
    here, _ = real_at(time_s)
    time = np.linspace(0.0, 8.0, points)
    share = np.linspace(-1.0, 1.0, futures)
    speed = SPEED_MPS * (1.0 + 0.35 * np.cos(7.0 * np.arange(futures)))
    along = speed[:, None] * time
    bend_at = -here[0] - 6.0
    beyond = np.clip(along - max(bend_at, 4.0), 0.0, None)
    turn = np.where(np.abs(share) > 0.4, np.sign(share), 0.0)
    radius = np.where(turn > 0, 8.0, 5.0)[:, None]
    angle = np.minimum(beyond / radius, np.pi / 2.0)
    straight = np.clip(beyond - radius * np.pi / 2.0, 0.0, None)
    turned = turn[:, None] != 0
    x = np.where(turned, along - beyond + radius * np.sin(angle), along)
    y = np.where(turned, turn[:, None] * (radius * (1.0 - np.cos(angle)) + straight), 0.0)
    y = y + 0.4 * share[:, None] * np.minimum(time / 3.0, 1.0)
    nominal = futures // 2
    x[nominal], y[nominal] = SPEED_MPS * time, 0.0
    xy, _ = _in_drive(np.stack([x + here[0], y + here[1]], axis=-1), 0.0)
    criticality = np.clip(np.abs(np.sin(0.37 * np.arange(futures) + 0.5 * time_s)) * 1.05, 0, 1)
    return RoundView(
        round_id=round(time_s * 2),
        stamp_ns=START_NS + round(time_s * 1e9),
        intersection_id="x1",
        world_id=WORLD_ID,
        xy_m=xy.astype(np.float32),
        criticality=criticality.astype(np.float32),
        likelihood=(1.0 - 0.5 * criticality).astype(np.float32),
        nominal_index=nominal,
        names=tuple(
            "nominal" if i == nominal else f"lead brakes, grip {0.4 + 0.6 * i / futures:.2f}"
            for i in range(futures)
        ),
        collided=int((criticality >= 1.0).sum()),
        min_clearance_m=0.4,
        latency_ms=180.0,
        user_xy_m=xy[:2, ::-1].astype(np.float32),
        touch_xy_m=xy[:1, -1].astype(np.float32),
        touch_names=("ltap_od",),
    )


def plan_at(time_s: float) -> PlannedTrajectory:
    """Return the car's own plan: straight on, a metre to the left."""
    time = np.linspace(0.0, 5.0, 26)
    here, _ = real_at(time_s)
    xy = here + np.column_stack([SPEED_MPS * time, np.ones_like(time)])
    geo = geo_from_local(WORLD_FRAME, xy)
    return PlannedTrajectory(
        stamp_ns=START_NS + round(time_s * 1e9),
        time_from_stamp_s=time,
        lat_deg=geo[:, 0].copy(),
        lon_deg=geo[:, 1].copy(),
        yaw_rad=np.zeros_like(time),
        speed_mps=np.full_like(time, SPEED_MPS),
    )


def _error(ade_m: float) -> HorizonError:
    return HorizonError(
        ade_m=ade_m, fde_m=2 * ade_m, lateral_m=0.1, longitudinal_m=ade_m, heading_rad=0.01
    )


def drive(*, duration_s: float = DURATION_S, world: bool = True) -> Iterator[Message]:
    """Yield the messages of the whole drive in the order of time."""
    yield Message(
        "event",
        Event(
            stamp_ns=START_NS,
            level="info",
            source="mission",
            text="Kronenstraße / 東京通り ahead 🚗",
        ),
    )
    if world:
        yield Message(
            "world",
            WorldNotice(world_id=WORLD_ID, intersection_id="x1", file=f"{WORLD_ID}.world"),
        )
    yield Message("active_world", ActiveWorld(stamp_ns=START_NS, world_id=WORLD_ID))
    for tick in range(round(duration_s * 50)):
        time_s = tick / 50.0
        stamp_ns = START_NS + round(time_s * 1e9)
        state = state_at(time_s)
        yield Message("state", state)
        if tick % 5 == 0:
            yield Message("gnss", GnssFix(stamp_ns=stamp_ns, position=state.position))
            yield Message("mirror", mirror_at(time_s))
            yield Message("plan", plan_at(time_s))
        if tick % 10 == 0:
            yield Message(
                "progress",
                Progress(
                    stamp_ns=stamp_ns,
                    drive_time_s=time_s,
                    mission_state="rounds",
                    next_intersection="Kronenstraße / 東京通り",
                    arrival_in_s=max(0.0, 10.0 - time_s),
                    futures_per_s=128.0,
                    dropped=0,
                ),
            )
        if tick % 25 == 0:
            yield Message("round", round_at(time_s))
            for worker, busy in (("w0", tick % 50 == 0), ("w1", tick % 75 == 0)):
                yield Message(
                    "worker_status",
                    WorkerStatus(
                        stamp_ns=stamp_ns,
                        worker_id=worker,
                        state="busy" if busy else "idle",
                        rtf=40.0 + tick % 7,
                    ),
                )
            for horizon_s in (1.0, 2.0, 4.0, 8.0):
                error = 0.02 * horizon_s**1.5 * (1.2 + np.sin(time_s / 2))
                yield Message(
                    "comparison",
                    Comparison(
                        round_id=tick // 25,
                        stamp_ns=stamp_ns,
                        intersection_id="x1",
                        horizon_s=horizon_s,
                        nominal=_error(error),
                        constant_velocity=_error(1.6 * error),
                        constant_turn_rate=_error(2.0 * error),
                    ),
                )
            yield Message(
                "plan_comparison",
                PlanComparison(
                    round_id=tick // 25,
                    stamp_ns=stamp_ns,
                    plan_stamp_ns=stamp_ns,
                    horizon_s=5.0,
                    difference=_error(1.0),
                    path_offset_m=1.0,
                ),
            )
        if tick == 500:
            yield Message(
                "event",
                Event(
                    stamp_ns=stamp_ns, level="warning", source="worker w1", text="late by 120 ms"
                ),
            )
    yield Message(
        "end",
        DriveEnd(stamp_ns=START_NS + round(duration_s * 1e9), published={"gnss": 200}),
    )
