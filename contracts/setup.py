"""What each process is started with: one JSON file, named on its command line."""

from __future__ import annotations

from typing import Literal

import msgspec

from foretwin.contracts.anchor import Anchor
from foretwin.contracts.campaign import TlsFiles
from foretwin.contracts.fleet import MachineInfo
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.layout import Layout
from foretwin.contracts.planner_link import PlannerJoined
from foretwin.contracts.point_cloud import Mount
from foretwin.contracts.ports import WEB_PORT
from foretwin.contracts.process_setup import BusSetup as BusSetup
from foretwin.contracts.process_setup import ProcessSetup as ProcessSetup
from foretwin.contracts.process_setup import read_setup as read_setup
from foretwin.contracts.process_setup import write_setup as write_setup
from foretwin.contracts.roles import MirrorCast
from foretwin.contracts.segments import Roll
from foretwin.contracts.towards_vehicle import OrderKeys
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.virtual_traffic import VirtualTraffic
from foretwin.contracts.world import ATTRIBUTION


class ReplaySetup(ProcessSetup, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A recorded drive; times are seconds from the log's start. `speed` None is lock step."""

    log: str
    start_s: float = 0.0
    end_s: float | None = None
    speed: float | None = 1.0
    anchor: Anchor | None = None
    """Of a drive that was recorded on a lot."""


class StandinSetup(ProcessSetup, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The stand-in car; `path_file` is a JSON object with lat_deg, lon_deg, speed_mps arrays."""

    path_file: str
    parameters_file: str | None = None
    end_s: float | None = None
    speed: float | None = 1.0
    seed: int = 0
    plan_shift_m: float = 0.0
    """Moves the published plan to the left: a known error, for tests of the plan comparison."""
    anchor: Anchor | None = None
    """It drives on that lot; the path is one of the World."""
    beside: bool = False
    """Whether it is a vehicle beside the car, by a clock of its own."""


class RecorderSetup(ProcessSetup, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Writes the vehicle's channels to MCAP files."""

    file: str
    """The first of them; see foretwin.contracts.segments."""
    roll: Roll = Roll()


class Ros2Setup(ProcessSetup, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The gateway to ROS 2; `mapping` is the text of its TOML, as it was when it was checked.

    `towards_vehicle` is the command line's switch; the mapping holds the other.
    """

    mapping: str
    mapping_name: str
    drive_frame: LocalFrame
    towards_vehicle: bool = False
    order_keys: OrderKeys | None = None
    """Whose orders towards the vehicle count; None: nobody's."""
    vehicle: VehicleParameters | None = None
    """Of the car: the size of its twin."""
    anchor: Anchor | None = None
    """Of a car on a lot: its topics live there, the run in the World."""
    fence: tuple[tuple[float, float], ...] = ()
    """Of the lot, corners in degrees; outside, nothing goes to the car."""
    mounts: tuple[tuple[str, Mount], ...] = ()
    """Where sensors sit on the car in the World, by their names: those whose clouds pass."""
    listens_only: bool = False
    """Of a vehicle beside the car: nothing goes out to it, whatever the mapping says."""


STACK_LOGS = "stacks"
"""Beside a sweep's log: the folder of what the processes of driving stacks print."""


class StackSetup(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A driving stack of somebody else, which each worker of a sweep starts for itself."""

    command: tuple[str, ...]
    folder: str | None = None
    """In which it is started; None: where its worker was."""
    instances: int = 1
    """So many processes, among which the futures of a job are dealt out."""
    answer_within_s: float = 60.0
    """Of wall time: who has not answered by then hangs. Chosen as `ALIVE_S` of `remote`, doubled,
    since in a sweep the whole machine is at work."""
    start_within_s: float = 120.0
    """Of wall time, from its start until it joins. Chosen: a stack may load maps and models."""
    says: PlannerJoined | None = None
    """Who it was when the sweep began."""


class WorkerSetup(ProcessSetup, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A worker of one role; `drive_frame` is the frame of MirrorSample, None where none is made."""

    role: str
    worlds_dir: str
    vehicle: VehicleParameters
    swept_vehicles: tuple[VehicleParameters, ...] = ()
    """Those that jobs of a sweep name by their digests; a drive's are played with `vehicle`."""
    simulations: int = 32
    """The most futures of a job: two workers share a round of 64."""
    kept_worlds: int = 8
    """So many Worlds stay compiled for each vehicle."""
    drive_frame: LocalFrame | None = None
    control_hz: float = 20.0
    mirror_window_s: float = 8.0
    mirror_rate_hz: float = 10.0
    commands_recorded: bool = False
    mirror_cast: MirrorCast = MirrorCast()
    threads: int = 1
    gives_way: bool = False
    """Whether it is the last to have a processor, from its start on."""
    planners: tuple[str, ...] = ()
    """Loaded before the first job: those of other packages live in processes of their own."""
    stacks: tuple[tuple[str, StackSetup], ...] = ()
    """Driving stacks, by the names under which a sweep's futures know them."""


class TrafficSetup(ProcessSetup, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Virtual traffic around `vehicle`, the car."""

    vehicle: VehicleParameters
    worlds_dir: str
    traffic: VirtualTraffic
    seed: int


SensorSees = Literal["world", "users", "real"]
"""What rays of a virtual sensor meet: the World and the road users in it, or these alone; or what a
sensor of the car has measured, into which these are put."""


class SensorSetup(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A virtual sensor: the text of its TOML, as it was when it was checked, and its file."""

    text: str
    name: str
    sees: SensorSees = "world"


class SensorsSetup(ProcessSetup, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Measures what virtual sensors on the car would; each turn is told, clouds on `point_cloud`,
    lists of radars on `radar_list`, pictures on `camera_image`, positions on
    `sensed_gnss`, what inertial sensors say on `sensed_imu`."""

    worlds_dir: str
    turns_dir: str
    """Where it says how many turns were told and passed over."""
    sensors: tuple[SensorSetup, ...]
    seed: int = 0


class FarWorkerSetup(ProcessSetup, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A worker on another machine: all else it is told by the drive that it joins."""

    machine: MachineInfo
    cache_dir: str
    """Where Worlds are kept, by their ids, for this drive and the next."""


class TuningSetup(ProcessSetup, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Identifies `vehicle` from its driving and watches its gap to reality, in `drive_frame`."""

    vehicle: VehicleParameters
    drive_frame: LocalFrame
    slopes: str | None = None
    """A file of RoadSlopes in that frame, where the map has heights."""


class BuilderSetup(ProcessSetup, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Builds Worlds from one map into one folder, through a cache shared between runs.

    `added_roads` are indices of edges that count as car roads though the map does not say so,
    `driven_edges` those of the route, each with whether it is driven in reverse.
    """

    map: str
    near_deg: tuple[tuple[float, float], ...] = ()
    """Of a large map, what lies within `margin_m` of this line of degrees; empty: all of it."""
    margin_m: float = 0.0
    added_roads: tuple[int, ...] = ()
    driven_edges: tuple[tuple[int, bool], ...] = ()
    dem: str | None = None
    """Heights of the ground."""
    tracks: str | None = None
    """A store of tracks that correct where lanes lie."""
    worlds_dir: str
    cache_dir: str
    given_worlds: str | None = None
    """A folder of Worlds that are used as they are, instead of being built."""


class ViewerSetup(ProcessSetup, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Writes `file`; `live` adds a window (native), a browser server (web) or nothing (none)."""

    file: str
    worlds_dir: str
    drive_frame: LocalFrame
    roll: Roll = Roll()
    live: str = "none"
    page_port: int = WEB_PORT
    """Of this machine, for browsers."""
    layout: Layout | None = None
    """None is that of a drive."""
    roads: str | None = None
    """A file of the RoadsShown of the whole map and the route."""
    anchor: Anchor | None = None
    """Which place of the World the car's lot is."""
    fence: tuple[tuple[float, float], ...] = ()
    """Of that lot, as an anchor file has it."""
    title: str = "foretwin"
    attribution: str = ATTRIBUTION
    start_stamp_ns: int = 0


class CopilotSetup(ProcessSetup, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Serves the co-pilot display at `host` and `port`; frames lie in `drive_frame`."""

    drive_frame: LocalFrame
    port: int
    host: str = "127.0.0.1"
    worlds_dir: str | None = None
    """None: Worlds are asked for over the bus."""
    start_stamp_ns: int = 0
    attribution: str = ATTRIBUTION
    seat: str = "co-pilot"
    """Who marks events here, where the page does not say it."""
    operator: BusSetup | None = None
    """How roles are changed from the page; None: nobody may there."""
    page_tls: TlsFiles | None = None
    """The certificate that the page is served with; without one only on the loopback interface."""
    awaited: bool = True
    """Whether the drive has started it and waits for its token; another seat's says where it is."""
    frames_file: str | None = None
    """Where what the display showed is kept."""
