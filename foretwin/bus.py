"""What a program beside foretwin needs to speak on the bus of a drive: docs/bus.md.

`examples/remote_planner.py` is the stack of a planner under test, `examples/virtual_road_user.py` a
road user for the car's own stack.
"""

from __future__ import annotations

from foretwin.contracts.bus import Alive, Bus, BusUnreachable, Mailbox, Received, ZenohBus
from foretwin.contracts.campaign import certificate_in
from foretwin.contracts.drive import RoadUser, RoadUsers
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local
from foretwin.contracts.joining import RunningDrive, newest_running, running_drive
from foretwin.contracts.keys import alive_key, run_of_alive_key
from foretwin.contracts.planner_link import PlannedMotions, PlannerScene
from foretwin.contracts.planner_serving import serve_planner
from foretwin.contracts.setup import BusSetup
from foretwin.contracts.signing import OrderSigner
from foretwin.contracts.towards_vehicle import VehicleCommand

__all__ = [
    "Alive",
    "Bus",
    "BusSetup",
    "BusUnreachable",
    "GeoPoint",
    "LocalFrame",
    "Mailbox",
    "OrderSigner",
    "PlannedMotions",
    "PlannerScene",
    "Received",
    "RoadUser",
    "RoadUsers",
    "RunningDrive",
    "VehicleCommand",
    "ZenohBus",
    "alive_key",
    "certificate_in",
    "geo_from_local",
    "newest_running",
    "run_of_alive_key",
    "running_drive",
    "serve_planner",
]
