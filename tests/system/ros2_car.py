"""A car behind zenoh-bridge-ros2dds that drives the embedded route: plain CDR on plain keys."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from foretwin.contracts import drive
from foretwin.contracts.foreign_bus import Arrived, ZenohForeignBus
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local, local_from_geo
from foretwin.contracts.mailbox import Mailbox
from foretwin.orchestrator.embedded import ROUTE_FILE
from foretwin.telemetry.logs import read_line
from foretwin.telemetry.ros_messages.parts import (
    NAV_SAT_FIX,
    STEERING_REPORT,
    VELOCITY_REPORT,
    ros_type,
    time_from,
    typestore,
)
from foretwin.telemetry.ros_messages.sensors import ros_from_gnss
from tests.telemetry.autoware_messages import velocity_report

SPEED_MPS = 8.0
REPORT_EVERY_S = 0.02


class Ros2Car:
    """Publishes GNSS at 10 Hz, speed and steering at 50 Hz, and keeps what comes back."""

    def __init__(
        self,
        bus: ZenohForeignBus,
        *,
        listens_to: tuple[str, ...] = (),
        namespace: str = "",
        ahead_m: float = 0.0,
    ) -> None:
        """`namespace` is its bridge's, such as `second/`; it begins `ahead_m` along the route."""
        self._bus, self._namespace, self._ahead_m = bus, namespace, ahead_m
        self.heard = Mailbox(100_000)
        for key in listens_to:
            bus.subscribe(key, self.heard)
        line_deg = read_line(ROUTE_FILE).lat_lon_deg
        self._frame = LocalFrame(GeoPoint(float(line_deg[0, 0]), float(line_deg[0, 1])))
        self._xy_m = local_from_geo(self._frame, line_deg[:, 0], line_deg[:, 1])
        steps_m = np.hypot(*np.diff(self._xy_m, axis=0).T)
        self._arc_m = np.concatenate(([0.0], np.cumsum(steps_m)))
        self._started_s = time.monotonic()
        self._turn = 0

    def drive_until(
        self, *, deadline_s: float, beside: Sequence[Callable[[], None]] = ()
    ) -> Arrived | None:
        """Drive on until something comes back; None where nothing does in so many seconds.

        `beside` lets others drive on too.
        """
        until_s = time.monotonic() + deadline_s
        while time.monotonic() < until_s:
            for go_on in (self.go_on, *beside):
                go_on()
            item = self.heard.take(0.005)
            if item is not None:
                assert isinstance(item, Arrived)
                return item
        return None

    def go_on(self) -> None:
        """Report where it is, where a report is due."""
        if time.monotonic() - self._started_s >= REPORT_EVERY_S * self._turn:
            self._report()

    def place(self) -> GeoPoint:
        """Where it is now."""
        arc_m = self._ahead_m + (time.monotonic() - self._started_s) * SPEED_MPS
        xy_m = np.array([[np.interp(arc_m, self._arc_m, axis) for axis in self._xy_m.T]])
        lat_deg, lon_deg = geo_from_local(self._frame, xy_m)[0].tolist()
        return GeoPoint(lat_deg, lon_deg)

    def _report(self) -> None:
        stamp_ns = time.time_ns()
        if self._turn % 5 == 0:
            fix = drive.GnssFix(stamp_ns=stamp_ns, position=self.place(), std_m=0.1)
            ros = ros_from_gnss(fix, None)
            self._put("sensing/gnss/ublox/nav_sat_fix", ros, NAV_SAT_FIX)
        speed = velocity_report(stamp_ns, speed_mps=SPEED_MPS, yaw_rate_radps=0.0)
        self._put("vehicle/status/velocity_status", speed, VELOCITY_REPORT)
        steering = ros_type(STEERING_REPORT)(stamp=time_from(stamp_ns), steering_tire_angle=0.0)
        self._put("vehicle/status/steering_status", steering, STEERING_REPORT)
        self._turn += 1

    def _put(self, key: str, ros: object, kind: str) -> None:
        self._bus.put(self._namespace + key, bytes(typestore().serialize_cdr(ros, kind)))
