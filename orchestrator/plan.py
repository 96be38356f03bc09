"""What a drive is made of: its inputs, all read and checked, and the folder of its run."""

from __future__ import annotations

import socket
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import msgspec

from foretwin.contracts.access import BusMember
from foretwin.contracts.anchor import Anchor
from foretwin.contracts.anchor_file import AnchorFile
from foretwin.contracts.campaign import role_files
from foretwin.contracts.drive import VehicleInfo
from foretwin.contracts.elevation import RoadSlopes
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.local_bus import LocalBus
from foretwin.contracts.ports import WEB_PORT
from foretwin.contracts.segments import DRIVE_FILE
from foretwin.contracts.setup import BusSetup, SensorSetup
from foretwin.contracts.towards_vehicle import OrderKeys
from foretwin.contracts.trace import TRACE_PARTS
from foretwin.contracts.tracks import DrivenTrack
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.campaign.joining import admission
from foretwin.orchestrator.config import DriveConfig, OtherVehicleConfig
from foretwin.orchestrator.forecast.progress_model import ProgressModel
from foretwin.orchestrator.keep import Keep, parse_keep
from foretwin.orchestrator.routing.road_index import RoadIndex
from foretwin.orchestrator.routing.route import Route
from foretwin.orchestrator.routing.route_ahead import WayAhead
from foretwin.orchestrator.routing.standin_path import StandinPath
from foretwin.telemetry.ros2.mapping import MappingFile
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.opening import Clip
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.roads.road_graph import EdgeKey, RoadGraph
from foretwin.world_gen.roads.turn_restrictions import read_turn_restrictions


class OtherVehiclePlan(NamedTuple):
    """A vehicle beside the car, its parameters, and whether its commands are recorded."""

    config: OtherVehicleConfig
    vehicle: VehicleParameters
    commands_recorded: bool
    ros2: MappingFile | None = None
    """How its own ROS 2 topics are read."""
    lot: Anchor | None = None
    """Where it really is, and where that is in the World."""
    scale: float = 1.0
    """Of a small car: metres in the World for one of its own."""


@dataclass(frozen=True, kw_only=True)
class DriveInputs:
    """Everything read: nothing here has touched the folder of runs yet."""

    config: DriveConfig
    map_file: Path
    clip: Clip | None
    """What of a large map is read: the surroundings of the way known beforehand."""
    osm: OsmMap
    graph: RoadGraph
    index: RoadIndex
    junctions: tuple[Junction, ...]
    added_roads: tuple[int, ...]
    """Indices of service roads that count as car roads in this drive."""
    driven_edges: tuple[EdgeKey, ...]
    """Those of the routes, which tell which way round tidal roads are driven."""
    routes: tuple[Route, ...]
    route_source: str
    drive_frame: LocalFrame
    slopes: RoadSlopes | None
    """How the map's roads climb, in that frame; None where they are flat."""
    vehicle: VehicleParameters
    beside: tuple[OtherVehiclePlan, ...]
    log_file: Path | None
    info: VehicleInfo | None
    standin: StandinPath | None
    anchor: AnchorFile | None = None
    """Where the car really is; None: where the World is."""
    ros2: MappingFile | None = None
    """How the live car's ROS 2 topics are read, and what goes back."""
    progress: ProgressModel | None = None
    """What forecasts how far the car will get; None where nobody wants to know."""
    sensors: tuple[SensorSetup, ...] = ()
    """Virtual ones on the car."""
    tracks: tuple[DrivenTrack, ...] = ()
    """Of earlier drives near the map, where the user asks for them."""

    @property
    def lot(self) -> Anchor | None:
        """How the car's lot lies in the World; None where it drives in the World."""
        return None if self.anchor is None else self.anchor.anchor

    @property
    def towards_vehicle(self) -> bool:
        """Whether both switches are on: anything may go out towards the vehicle."""
        enabled = self.ros2 is not None and self.ros2.mapping.towards_vehicle.enabled
        return enabled and self.config.towards_vehicle

    @property
    def commands_recorded(self) -> bool:
        """Whether the vehicle sends the commands that its automated driving gives."""
        return self.info is None or "control" in self.info.sends

    def way_ahead(self) -> WayAhead:
        """Return where the car is on the map and what comes, before the drive begins."""
        return WayAhead(
            self.graph,
            self.junctions,
            self.routes,
            index=self.index,
            tracks=self.tracks,
            restrictions=read_turn_restrictions(self.osm, self.graph),
        )


@dataclass(frozen=True, kw_only=True)
class DrivePlan(DriveInputs):
    """The inputs with a run's id, its folder and its bus."""

    run_id: str
    folder: Path
    bus: BusSetup
    """How the orchestrator joins; without an endpoint until the bus of this host is made."""
    live_view: str
    page_port: int = WEB_PORT
    """Of this machine, where browsers find the viewer."""
    local: LocalBus | None = None
    """The bus of this host; None where anybody may join at `endpoint`."""
    order_keys: OrderKeys | None = None
    """Whose orders towards the vehicle count, while anything may go there."""
    copilot_port: int | None = None
    """Where the co-pilot display is served; None where there is none."""
    metrics: socket.socket | None = None
    """Listens for who asks for metrics; None where nobody may."""

    @property
    def router_bus(self) -> BusSetup:
        """How the router is set."""
        if self.config.secure is not None:
            tls = role_files(Path(self.config.secure), "router")
            admits = admission(self.run_id, Path(self.config.secure))
            return msgspec.structs.replace(self.bus, tls=tls, admits=admits)
        return self.bus if self.local is None else self.local.router

    def bus_of(self, member: BusMember) -> BusSetup:
        """Return how one of the drive's processes joins the bus."""
        if self.config.secure is not None:
            tls = role_files(Path(self.config.secure), member.role)
            return msgspec.structs.replace(self.bus, tls=tls)
        return self.bus if self.local is None else self.local.setup_of(member.name)

    @property
    def worlds_dir(self) -> Path:
        """Where this run's Worlds lie."""
        return self.folder / "worlds"

    @property
    def processes_dir(self) -> Path:
        """Where the setups of this run's processes lie."""
        return self.folder / "processes"

    @property
    def trace_dir(self) -> Path | None:
        """Where processes leave what they do when, None where nobody asked for it."""
        return self.folder / TRACE_PARTS if self.config.trace else None

    @property
    def router_word_file(self) -> Path:
        """Where the router says that it listens, or why it cannot."""
        return self.processes_dir / "router.word"

    @property
    def recording(self) -> Path:
        """What the vehicle sent; where it has several parts, the first of them."""
        return self.folder / DRIVE_FILE

    @property
    def origin(self) -> dict[str, str]:
        """What every table of results says of its run."""
        osm = self.osm
        return {"run_id": self.run_id, "attribution": osm.attribution, "map": osm.sha256}

    @property
    def keep(self) -> Keep:
        """How much of the run stays while it goes on."""
        return parse_keep(self.config.keep)

    @property
    def standin_path_file(self) -> Path:
        """What the stand-in car drives."""
        return self.processes_dir / "standin_path.json"

    @property
    def slopes_file(self) -> Path:
        """How the map's roads climb, where they do."""
        return self.processes_dir / "slopes.msg"

    @property
    def roads_file(self) -> Path:
        """The whole map and the route, as the viewer draws them."""
        return self.processes_dir / "roads.msg"

    @property
    def start_stamp_ns(self) -> int:
        """The stamp of drive time 0."""
        return 0 if self.info is None else self.info.start_stamp_ns
