"""What a sweep runs over: one TOML file, checked into one frozen struct."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import msgspec

from foretwin.contracts.did_you_mean import one_of
from foretwin.contracts.errors import UserError
from foretwin.contracts.futures import RESULT_STEP_S, EngineName
from foretwin.contracts.numbers import FUTURE_NUMBERS, MAX_SEED, out_of_range
from foretwin.contracts.placement import AS_RECORDED, RecordedStart
from foretwin.contracts.planner_link import PlannerJoined
from foretwin.contracts.scenario import Scenario
from foretwin.contracts.toml_file import load_toml
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.config import MAX_RADIUS_M, MIN_RADIUS_M
from foretwin.orchestrator.sweep.recorded import WORLDS, Recorded, read_drive
from foretwin.orchestrator.sweep.stacks import (
    FUTURES_PER_JOB,
    RemoteStack,
    check_remote,
    introduced,
)
from foretwin.orchestrator.worlds.choice import node_of_id, parse_bbox
from foretwin.sim_worker.engines.registry import trouble_with_engine
from foretwin.sim_worker.metrics.table import METRICS, ROW_METRICS
from foretwin.sim_worker.planners.registry import REMOTE, check_planner
from foretwin.sim_worker.scenarios.reading import catalogue, find_scenario
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.timestep import TIMESTEP_S
from foretwin.telemetry.logs.road_users import RoadUserLog

_TIMES = "ttc", "pet", "thw"
_IMPACTS = "drac", "required_deceleration", "impact_speed", "delta_v"
_COMFORT = "max_deceleration", "max_lateral_acceleration", "max_jerk", "comfortable"
_RULES = "off_road_share", "red_light_violations", "right_of_way_violations", "driving_score"
DEFAULT_METRICS = (*_TIMES, *_IMPACTS, *_COMFORT, *_RULES)
_START_IT = (
    "planners: remote asks a stack that somebody has started beside a drive; a sweep starts it "
    'itself: [remote.NAME] with command = "…", and NAME among the planners'
)
_SHOWS = "The ego drives on from where the car was, among those who were there."
JUST_RECORDED = Scenario(id=AS_RECORDED, title="As recorded", source="the drive", shows=_SHOWS)


class SweepSpec(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Everything that decides the rows of a sweep; paths are relative to where it is started."""

    map: str | None = None
    """Map of the place (.osm, .osm.gz, .osm.bz2, .osm.pbf)."""
    worlds: str | None = None
    """A folder of .world files, in place of a map."""
    recorded: Recorded | None = None
    """A recorded drive, in place of both: its Worlds, its states, its ways."""
    junctions: Literal["all"] | tuple[str, ...] = "all"
    """Ids, as `foretwin intersections MAP` tells them."""
    bbox: str | None = None
    """W,S,E,N in degrees: only junctions in there."""
    sample: int | None = None
    """So many of these junctions, drawn by the seed; None takes all."""
    radius_m: float | None = None
    """How far a World of the map reaches around its junction; None is 150."""
    service_roads: bool = False
    """Whether driveways and parking aisles of the map make junctions."""
    dem: str | None = None
    """Heights of the ground under the map (.hgt, .hgt.zip, GeoTIFF, or a folder); None is flat."""
    scenarios: tuple[str, ...] | None = None
    """Ids of the catalogue or TOML files; None takes the whole catalogue. From where a real car
    was, `as_recorded` adds nobody to those who were there."""
    places: int = 1
    """At most so many places of a scenario at one junction."""
    cases: Literal["all"] | int = "all"
    """So many of each scenario's cases, drawn by the seed."""
    samples: int | None = None
    """Draws for each combination of listed values; None takes the scenario's own number."""
    planners: tuple[str, ...] = ("pure_pursuit_idm",)
    """Planners by name, or stacks of `remote`; docs/planners.md."""
    remote: dict[str, RemoteStack] = {}
    """Driving stacks by the names under which `planners` knows them."""
    vehicles: tuple[str, ...] = ("bmw_320i",)
    """Bundled vehicles by name, or parameter files; the first decides on the places."""
    physics: EngineName = "mujoco"
    """Whose physics moves the cars: mujoco, multibody or gazebo; docs/engines.md."""
    metrics: tuple[str, ...] = DEFAULT_METRICS
    """What is measured of each future; docs/metrics.md."""
    parameters: dict[str, tuple[float, ...]] = {}
    """Lists for numbers of a future, every combination of which is played."""
    horizon_s: float | None = None
    """None takes each scenario's own."""
    control_hz: float = 20.0
    """Control ticks of the planners."""
    accidents: bool = True
    """Whether collisions with road users are run on as two bodies."""
    lights_by_plan: bool = True
    """Whether lights follow the World's plans; else nobody stops for them."""
    job_timeout_s: float = 600.0
    """After so long without an answer, a job of up to 64 futures counts as failed."""
    seed: int = 0
    """Draws cases and samples."""


class Loaded(msgspec.Struct, frozen=True, kw_only=True):
    """A spec with all that it names, read and checked."""

    spec: SweepSpec
    scenarios: tuple[Scenario, ...]
    vehicles: dict[str, VehicleParameters]
    starts: tuple[RecordedStart, ...] = ()
    """Where a recorded car was; without them, egos start where their cases say."""
    road_users: RoadUserLog | None = None
    """Who was around the recorded car."""
    stacks: dict[str, PlannerJoined] = {}
    """Of those `remote` that are among the planners, who they say that they are."""


def load_spec(path: Path, *, start_stacks: bool = True) -> Loaded:
    """Read a sweep's TOML file and what it names; driving stacks are started once, if they may.

    Raises FileNotFoundError or UserError, in one line that names the file and the field.
    """
    file = load_toml(path, "sweep")
    spec = file.convert(SweepSpec)
    try:
        return check_spec(spec, start_stacks=start_stacks)
    except FileNotFoundError as error:
        raise FileNotFoundError(f"{path}: {error}") from error
    except ValueError as error:
        raise file.wrong(error) from error


def check_spec(spec: SweepSpec, *, start_stacks: bool = True) -> Loaded:
    """Return a spec with what it names; raises ValueError for the first thing that is wrong."""
    for holds, text in _checks(spec):
        if not holds:
            raise UserError(text)
    if spec.bbox is not None:
        parse_bbox("bbox", spec.bbox)
    if spec.junctions != "all":
        for name in spec.junctions if spec.map is not None else ():
            node_of_id(name)
    if (engine := trouble_with_engine(spec.physics)) is not None:
        raise UserError(f"physics: {engine}")
    check_remote(spec.remote, control_hz=spec.control_hz)
    for name in spec.planners:
        if name == REMOTE and name not in spec.remote:
            raise UserError(_START_IT)
        if name not in spec.remote:
            check_planner(name, in_drive=False)
    _check_metrics(spec.metrics)
    _check_parameters(spec.parameters)
    scenarios = _scenarios(spec)
    vehicles = {name: load_vehicle(name) for name in spec.vehicles}
    loaded = Loaded(spec=spec, scenarios=scenarios, vehicles=vehicles)
    if spec.recorded is not None:
        starts, users = read_drive(spec.recorded, vehicles[spec.vehicles[0]])
        loaded = msgspec.structs.replace(loaded, starts=starts, road_users=users)
    if not start_stacks:
        return loaded
    stacks = {name: one for name, one in spec.remote.items() if name in spec.planners}
    return msgspec.structs.replace(loaded, stacks=introduced(stacks))


def futures_per_job(spec: SweepSpec, planner: str) -> int:
    """Return how many futures of a planner are played side by side at most."""
    return spec.remote[planner].futures_per_job if planner in spec.remote else FUTURES_PER_JOB


def worlds_folder(spec: SweepSpec) -> Path | None:
    """Return where the Worlds of a sweep lie already, None where they are built from a map."""
    if spec.recorded is not None:
        return Path(spec.recorded.run) / WORLDS
    return None if spec.worlds is None else Path(spec.worlds)


def _checks(spec: SweepSpec) -> Iterator[tuple[bool, str]]:
    """Yield what must hold, and what is said where it does not."""
    sources = [n for n in ("map", "worlds", "recorded") if getattr(spec, n) is not None]
    given = " and ".join(sources) or "none"
    yield len(sources) == 1, f"exactly one of map, worlds and recorded; got {given}"
    for name in ("dem", "radius_m", "service_roads"):
        value = getattr(spec, name)
        yield not value or spec.map is not None, f"{name} {value}: goes with a map alone"
    yield len(spec.junctions) > 0, 'junctions: at least one id, or "all"'
    radius = spec.radius_m is None or MIN_RADIUS_M <= spec.radius_m <= MAX_RADIUS_M
    yield radius, f"radius_m {spec.radius_m}: {MIN_RADIUS_M:g} to {MAX_RADIUS_M:g}"
    for name in ("sample", "places", "samples"):
        number = getattr(spec, name)
        yield number is None or number >= 1, f"{name} {number}: at least 1"
    cases = spec.cases == "all" or spec.cases >= 1
    yield cases, f'cases {spec.cases}: at least 1, or "all"'
    for name in ("planners", "vehicles"):
        names = getattr(spec, name)
        yield len(names) > 0, f"{name}: at least one name"
        yield len(set(names)) == len(names), f"{name}: each only once"
    horizon, hz = spec.horizon_s, spec.control_hz
    in_steps = horizon is None or (1.0 <= horizon <= 60.0 and _whole(horizon / RESULT_STEP_S))
    yield in_steps, f"horizon_s {horizon}: 1 to 60 seconds, in steps of {RESULT_STEP_S:g}"
    steps = 1.0 / (hz * TIMESTEP_S) if hz > 0.0 else 0.0
    divides = steps >= 1.0 and _whole(steps)
    yield divides, f"control_hz {hz:g}: must divide {1.0 / TIMESTEP_S:g} evenly"
    ticks = RESULT_STEP_S * hz
    multiple = ticks >= 1.0 - 1e-9 and _whole(ticks)
    yield multiple, f"control_hz {hz:g}: must be a multiple of {1.0 / RESULT_STEP_S:g}"
    yield spec.job_timeout_s > 0.0, f"job_timeout_s {spec.job_timeout_s:g}: above 0"
    if spec.recorded is not None:
        yield spec.recorded.every_s > 0.0, "recorded.every_s: above 0"
        yield spec.recorded.longest_gap_s > 0.0, "recorded.longest_gap_s: above 0"
        nobody = spec.recorded.road_users == "none"
        for name in ("road_user_log", "leave_out"):
            value = getattr(spec.recorded, name)
            yield not (nobody and value), f'recorded.{name}: nobody is there by road_users = "none"'
    yield 0 <= spec.seed <= MAX_SEED, f"seed {spec.seed}: 0 to {MAX_SEED}"


def _whole(number: float) -> bool:
    return abs(number - round(number)) < 1e-6


def _check_metrics(names: tuple[str, ...]) -> None:
    for name in names:
        if name in METRICS and "reference" in METRICS[name].needs:
            raise UserError(f"metrics: {name} compares with a reference, of which a sweep has none")
        if name in METRICS and METRICS[name].series:
            raise UserError(f"metrics: {name} is a series; a row holds single numbers")
        if name not in METRICS:
            raise UserError(f"metrics: unknown {name!r}; {one_of(name, ROW_METRICS)}")
    if len(set(names)) != len(names):
        raise UserError("metrics: each only once")


def _check_parameters(parameters: dict[str, tuple[float, ...]]) -> None:
    for name, values in parameters.items():
        if name not in FUTURE_NUMBERS:
            raise UserError(f"parameters: unknown {name!r}; {one_of(name, FUTURE_NUMBERS)}")
        if not values or len(set(values)) != len(values):
            raise UserError(f"parameters.{name}: at least one value, each only once")
        for value in values:
            if wrong := out_of_range(name, value, value):
                raise UserError(f"parameters.{name} {wrong}")


def _scenarios(spec: SweepSpec) -> tuple[Scenario, ...]:
    if spec.scenarios is None:
        found = tuple(catalogue().values())
    else:
        found = tuple(
            JUST_RECORDED if name == AS_RECORDED else find_scenario(name) for name in spec.scenarios
        )
        if AS_RECORDED in spec.scenarios and spec.recorded is None:
            raise UserError(f"scenarios: {AS_RECORDED} needs `recorded`")
    names = [scenario.id for scenario in found]
    if not names:
        raise UserError("scenarios: at least one id or file, or none of the setting for all")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise UserError(f"scenarios: {twice[0]} is named twice")
    if spec.samples is None:
        return found
    return tuple(msgspec.structs.replace(s, samples=spec.samples) for s in found)
