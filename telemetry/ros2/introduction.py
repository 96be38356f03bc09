"""What the gateway says of the vehicle to who asks, once its antenna's place can be known."""

from __future__ import annotations

from foretwin.contracts.bus import Request
from foretwin.contracts.drive import VehicleInfo
from foretwin.telemetry.anchored import world_from_lot_info
from foretwin.telemetry.logs.foreign_ros import time_base_of
from foretwin.telemetry.ros2.inwards import Inwards
from foretwin.telemetry.ros2.mapping import Mapping

_WAITS_NS = 1_500_000_000


class Introduction:
    """Answers questions for `info`; times are the host's monotonic clock."""

    def __init__(self, mapping: Mapping, inwards: Inwards, *, vehicle_id: str) -> None:
        self._mapping, self._inwards, self._vehicle_id = mapping, inwards, vehicle_id
        self._waiting: list[tuple[int, Request]] = []

    def info(self) -> VehicleInfo | None:
        """Return what is known of the vehicle, None before its first sample."""
        first_ns = self._inwards.first_stamp_ns
        if first_ns is None:
            return None
        info = VehicleInfo(
            vehicle_id=self._vehicle_id,
            time_base=time_base_of(first_ns),
            start_stamp_ns=first_ns,
            source=f"ROS 2 through {self._mapping.dialect}",
            reference_point="antenna",
            body_from_antenna_m=self._inwards.antenna_m,
            sends=self._inwards.channels,
        )
        return world_from_lot_info(self._inwards.anchor, info)

    def take(self, request: Request, *, now_ns: int) -> None:
        """Take a request for the vehicle's info."""
        self._waiting.append((now_ns, request))

    def answer(self, *, now_ns: int) -> None:
        """Answer what can be answered; who asked too early is refused in the end."""
        if not self._waiting:
            return
        info = self.info()
        kept = []
        for since_ns, request in self._waiting:
            early = now_ns - since_ns <= _WAITS_NS
            if early and (info is None or self._inwards.awaits_antenna):
                kept.append((since_ns, request))
            elif info is not None:
                request.reply(info)
            else:
                request.refuse("no sample of the vehicle yet")
        self._waiting = kept
