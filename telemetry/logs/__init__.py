"""Recorded drives of any kind, read as the messages a live car would send."""

from __future__ import annotations

from foretwin.telemetry.logs.log import Log, LogError
from foretwin.telemetry.logs.opening import open_log, open_road_users
from foretwin.telemetry.logs.route_line import RouteLine, line_of_log, read_line

__all__ = [
    "Log",
    "LogError",
    "RouteLine",
    "line_of_log",
    "open_log",
    "open_road_users",
    "read_line",
]
