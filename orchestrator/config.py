"""The configuration of a drive: one TOML file, flags over it, checked into one frozen struct."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Literal

import msgspec

from foretwin.contracts.errors import UserError
from foretwin.contracts.numbers import MAX_SEED, Range
from foretwin.contracts.ports import metrics_place, trouble_with_bus
from foretwin.contracts.roles import Correction, FollowLimits, Role
from foretwin.contracts.siblings import Siblings
from foretwin.contracts.virtual_traffic import VirtualTraffic
from foretwin.orchestrator.keep import parse_keep
from foretwin.orchestrator.other_vehicle_config import OtherVehicleConfig as OtherVehicleConfig
from foretwin.orchestrator.processors import processors, trouble_with_workers
from foretwin.orchestrator.sensor_config import SensorConfig as SensorConfig
from foretwin.orchestrator.settings import flag_of
from foretwin.orchestrator.tuning_choice import Tuning, TuningChoice, choose_tuning

View = Literal["auto", "native", "web", "copilot", "none"]
MapAiding = Literal["auto", "off"]
Source = Literal["auto", "log", "standin", "live"]
MIN_RADIUS_M, MAX_RADIUS_M = 20.0, 2000.0
"""Of a World around its junction."""
RANGES: Mapping[str, Range] = MappingProxyType(
    {
        "futures": Range(1, math.inf),
        "futures_per_job": Range(1, math.inf),
        "rate_hz": Range(0.0, 50.0, above_low=True),
        "horizon_s": Range(1.0, 60.0),
        "speed": Range(0.0, 1000.0, above_low=True),
        "seed": Range(0, MAX_SEED),
        "start_s": Range(0.0, math.inf),
        "radius_m": Range(MIN_RADIUS_M, MAX_RADIUS_M),
        "look_ahead_s": Range(5.0, 600.0),
    }
)
"""What the numbers of a drive may be, where that depends on no other setting."""


class ConfigError(UserError):
    """A setting that cannot be used; the message names it and what would be right."""


class DriveConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Everything that decides what a drive does; times in seconds of the drive.

    `speed` None is lock step (`--speed max`). `rate_hz` counts rounds per wall second; in lock
    step, where no wall clock exists, per second of the drive.
    """

    map: str | None = None
    """Map of the place (.osm, .osm.gz, .osm.bz2, .osm.pbf); None is a drawn town."""
    dem: str | None = None
    """Heights of the ground (.hgt, .hgt.zip, GeoTIFF, or a folder of these); None is flat."""
    tracks: str | None = None
    """A store of earlier drives that correct where lanes lie: `own`, or a folder; None is none."""
    route: str | None = None
    """A GPX or GeoJSON file, `from-log`, or `live`: to the live car's goal; None predicts it."""
    log: str | None = None
    """A recorded drive to replay, in place of the stand-in car."""
    source: Source = "auto"
    """Where telemetry comes from; `auto` is `log` where there is one, else `standin`."""
    start_s: float = 0.0
    """Seconds into the log at which the drive begins."""
    end_s: float | None = None
    """Seconds into the log, or of the stand-in drive, at which it ends; None is its own."""
    speed: float | None = 1.0
    """How many times faster than the car a replay goes; `"max"` is lock step."""
    workers: int = 2
    """Worker processes that play futures."""
    futures: int = 64
    """Futures of a round."""
    least_futures: int | None = None
    """A live round may run so few where the machine is too slow for all; None is a quarter of them,
    as many as `futures` holds every round at all."""
    futures_per_job: int = 32
    """So many futures at most are simulated together by one worker."""
    rate_hz: float = 2.0
    """Rounds per second."""
    horizon_s: float = 8.0
    """How many seconds ahead each future goes."""
    planner: str = "pure_pursuit_idm"
    """The planner under test; docs/planners.md."""
    scenarios: tuple[str, ...] | None = None
    """Ids of the catalogue or TOML files that happen in every second future; None is all that take
    place at junctions, none at all is an empty list."""
    seed: int = 0
    """Of everything that is drawn."""
    vehicle: str | None = None
    """A parameter file, or the name of a bundled vehicle; None is `bmw_320i`."""
    vehicle_id: str = "ego"
    """What the car is called on the bus."""
    role: Role = "all"
    """Of the car itself, as the drive begins: all is twin, shadow and ghost at once."""
    correction: Correction = "free"
    """Whether twins are drawn towards reality (follow) as the drive begins; see docs/roles.md."""
    tuning: Tuning | None = None
    """Whether the driving is asked for the vehicle's parameters and the model's gap, and whether
    what is found counts (apply) or is only told: a simulation that nobody has asked to change
    stays that of the vehicle file. None is `report` in lock step and where workers have a
    processor each, else `off`."""
    progress_table: str | None = None
    """What `foretwin learn-progress` learnt, for how far the car will get in the next seconds;
    None is the table that comes along, `off` is no forecast."""
    map_aiding: MapAiding = "auto"
    """Whether the map's roads help to find the car where its positions are rougher than they."""
    follow: FollowLimits = FollowLimits()
    """How hard a twin that follows may be drawn."""
    vehicles: tuple[OtherVehicleConfig, ...] = ()
    """Others in the mirror besides the car, each with a role of its own."""
    virtual_traffic: VirtualTraffic = VirtualTraffic()
    """Road users who exist nowhere else: one going simulation around the car; see
    docs/virtual-traffic.md."""
    siblings: Siblings = Siblings()
    """A second engine beside MuJoCo, that plays some futures again."""
    sensors: tuple[SensorConfig, ...] = ()
    """Sensors that measure the virtual world from the car; each takes half a core."""
    view: View = "auto"
    """Where the drive is shown; `auto` is a window where there is a display."""
    layout: str = "drive"
    """Of the viewer: one that comes along (drive, identify, gap, sweep), or a TOML file."""
    out: str = "runs"
    """Folder in which each run gets one of its own."""
    keep: str | None = None
    """How much of the run stays while it goes on: the newest hours (12h) or bytes (20GB)."""
    trace: bool = False
    """Whether all processes leave what they did when, as `trace.json`; docs/trace.md."""
    metrics: str | None = None
    """Where metrics are told to operators, a port or HOST:PORT; docs/operators.md."""
    radius_m: float = 150.0
    """How far a World reaches around its junction."""
    service_roads: bool = False
    """Whether driveways and parking aisles make junctions even where no given route uses them."""
    look_ahead_s: float = 60.0
    """How many seconds before the car arrives a junction is prepared."""
    cache_dir: str | None = None
    """Folder in which Worlds are kept between runs; None is the user's cache."""
    worlds: str | None = None
    """A folder of Worlds that are used as they are, instead of being built."""
    endpoint: str | None = None
    """Where the router listens, such as tcp/127.0.0.1:7447; None takes a socket of this user's."""
    insecure: bool = False
    """Whether whoever reaches `endpoint` may say anything."""
    secure: str | None = None
    """A campaign's folder: the bus is over a network, and each role shows its certificate."""
    anchor: str | None = None
    """A TOML file that says which place of the World the car's lot is; docs/mixed-reality.md."""
    standin_plan_shift_m: float = 0.0
    """How far to the left of its lane the plan of the stand-in car lies."""
    standin_dem: str | None = None
    """What the ground under the stand-in car really is, hidden from the twin; None is `dem`."""
    standin_parameters: str | None = None
    """What the stand-in car really is, hidden from the twin: a TOML file, or the bundled one."""
    ros2: str | None = None
    """A mapping in TOML, or `autoware`: the live car speaks ROS 2; see docs/ros2.md."""
    towards_vehicle: bool = False
    """One of two switches, and of the command line alone; the mapping holds the other."""

    def validate(self) -> DriveConfig:
        """Return self, or raise ConfigError naming the first setting that cannot be used."""
        for holds, text in self._checks():
            if not holds:
                raise ConfigError(text)
        return self

    def _checks(self) -> Iterator[tuple[bool, str]]:
        """Yield what must hold, and what is said where it does not."""
        workers = trouble_with_workers(self.workers)
        yield workers is None, f"{workers}"
        for name, allowed in RANGES.items():
            value = getattr(self, name)
            yield value is None or allowed.admits(value), f"{flag_of(name)} {value}: {allowed}"
        least = self.least_futures
        few = f"--least-futures {least}: 1 to --futures, which is {self.futures}"
        yield least is None or 1 <= least <= self.futures, few
        end = self.end_s is None or self.end_s > self.start_s
        yield end, f"--end {self.end_s}: after --start {self.start_s}"
        log, ros2, live = self.log is not None, self.ros2 is not None, self.source == "live"
        yield log or self.source != "log", "--source log needs --log FILE"
        no_log = f"--source {self.source}: takes no --log, which is {self.log}"
        yield not log or self.source in ("auto", "log"), no_log
        yield log or not self.start_s, f"--start {self.start_s}: needs --log FILE, to begin in it"
        ends = f"--end {self.end_s}: not of --source live, which ends with its car"
        yield self.end_s is None or not live, ends
        yield log or self.route != "from-log", "--route from-log needs --log FILE"
        goal = "--route live needs --source live: a car that says where it drives to"
        yield live or self.route != "live", goal
        yield live or not ros2, "--ros2 MAPPING needs --source live: its topics are the telemetry"
        max_speed = "--speed max: not of --source live, whose car nobody can hold up"
        yield not live or not self.lock_step, max_speed
        speaks = "--anchor needs --ros2 MAPPING with --source live"
        yield not (self.anchor and live) or ros2, speaks
        yield ros2 or not self.towards_vehicle, "--towards-vehicle needs --ros2 MAPPING"
        embedded = "--log needs --map FILE: the embedded map holds no real drive"
        yield self.map is not None or not log, embedded
        yield (
            self.map is None or log or self.route is not None or live,
            "--map needs --log FILE (a recorded drive), --route FILE (the stand-in car drives "
            "it) or --source live",
        )
        parse_keep(self.keep)
        if self.metrics is not None:
            metrics_place(self.metrics)
        for other in self.vehicles:
            trouble = other.trouble()
            yield trouble is None, f"vehicles, {other.id}: {trouble}"
        shift_m = self.standin_plan_shift_m
        yield math.isfinite(shift_m), f"standin_plan_shift_m {shift_m}: a finite number of metres"
        place = trouble_with_bus(self.endpoint, insecure=self.insecure, secure=self.secure)
        yield place is None, f"{place}"
        yield self.follow.trouble() is None, f"follow: {self.follow.trouble()}"
        traffic, siblings = self.virtual_traffic.trouble(), self.siblings.trouble()
        yield traffic is None, f"virtual_traffic: {traffic}"
        yield siblings is None, f"siblings: {siblings}"
        ids = [self.vehicle_id, *(other.id for other in self.vehicles)]
        yield len(set(ids)) == len(ids), f"vehicles: ids {', '.join(ids)} must differ"
        waiting = self.speed != 1.0 and any(other.live for other in self.vehicles)
        yield not waiting, "vehicles: a live vehicle knows no --speed but 1"

    @property
    def roles(self) -> dict[str, Role]:
        """Roles as the drive begins, by vehicle id, the car's own first."""
        others = {other.id: other.role for other in self.vehicles}
        return {self.vehicle_id: self.role, **others}

    @property
    def lock_step(self) -> bool:
        """Whether no clock runs: every round complete, results a pure function of the input."""
        return self.speed is None

    @property
    def tuning_choice(self) -> TuningChoice:
        """What `tuning` means here, and why."""
        lock_step, workers = self.lock_step, self.workers
        return choose_tuning(
            self.tuning, lock_step=lock_step, workers=workers, processors=processors()
        )

    @property
    def fewest_futures(self) -> int:
        """How few futures a round may run; in lock step, where nothing is late, all."""
        if self.lock_step:
            return self.futures
        return max(1, self.futures // 4) if self.least_futures is None else self.least_futures

    @property
    def resolved_source(self) -> Literal["log", "standin", "live"]:
        """What `auto` means here."""
        if self.source != "auto":
            return self.source
        return "log" if self.log is not None else "standin"

    @property
    def worlds_cache(self) -> Path:
        """The folder where Worlds are kept between runs."""
        if self.cache_dir is not None:
            return Path(self.cache_dir)
        base = os.environ.get("XDG_CACHE_HOME")
        return (Path(base) if base else Path.home() / ".cache") / "foretwin" / "worlds"


def has_display() -> bool:
    """Whether a window can be opened here."""
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
