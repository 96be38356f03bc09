"""Reads and checks everything a drive needs before anything is written."""

from __future__ import annotations

import datetime
import json
import secrets
import shutil
from pathlib import Path

import numpy as np

from foretwin.contracts.anchor import Anchor, AnchorLine
from foretwin.contracts.anchor_file import AnchorFile, anchor_text, read_anchor
from foretwin.contracts.arrays import Array
from foretwin.contracts.campaign import role_files
from foretwin.contracts.codec import write_message
from foretwin.contracts.drive import VehicleInfo
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local, local_from_geo
from foretwin.contracts.layout import read_layout
from foretwin.contracts.new_folder import trouble_with_folder
from foretwin.contracts.page_address import USUAL_PORT
from foretwin.contracts.ports import WEB_PORT, free_or
from foretwin.contracts.setup import BusSetup
from foretwin.contracts.terminal import say
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.campaign.joining import check_campaign
from foretwin.orchestrator.config import ConfigError, DriveConfig, OtherVehicleConfig, has_display
from foretwin.orchestrator.drive import sibling_setup, traffic_setup
from foretwin.orchestrator.drive.first_pose import with_first_pose
from foretwin.orchestrator.drive.ros2_mapping import read_ros2, read_ros2_beside
from foretwin.orchestrator.drive.sensors_setup import check_measured, read_sensor
from foretwin.orchestrator.embedded import MAP_FILE, ROUTE_FILE
from foretwin.orchestrator.forecast.progress_model import progress_of
from foretwin.orchestrator.plan import DriveInputs, DrivePlan, OtherVehiclePlan
from foretwin.orchestrator.rounds.jobs import scenarios_of
from foretwin.orchestrator.routing.line_matching import match_line
from foretwin.orchestrator.routing.road_index import RoadIndex
from foretwin.orchestrator.routing.roads_shown import roads_shown
from foretwin.orchestrator.routing.route import Route
from foretwin.orchestrator.routing.standin_path import standin_path
from foretwin.orchestrator.worlds.choice import read_route
from foretwin.orchestrator.worlds.given_worlds import check_given_worlds
from foretwin.orchestrator.worlds.heights import profiles_of, slopes_in
from foretwin.orchestrator.worlds.opening import open_map
from foretwin.orchestrator.worlds.track_store import tracks_for
from foretwin.sim_worker.planners.registry import check_planner
from foretwin.sim_worker.vehicle.parameters import DEFAULT_FILE, load_vehicle, scale_of
from foretwin.telemetry.logs import LogError, line_of_log, open_log
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.world_gen.opening import Clip
from foretwin.world_gen.roads.road_graph import RoadGraph
from foretwin.world_gen.roads.service_roads import open_service_roads

NEAR_ROAD_M = 50.0
"""A log none of whose positions lies this near to a road was not driven in this map."""
CORRIDOR_M = 2000.0
"""Of a large map, what lies within this distance of a given route or drive is read."""


def read_inputs(config: DriveConfig) -> DriveInputs:
    """Read map, log, route and vehicle; raises UserError or FileNotFoundError, one line each."""
    try:
        check_planner(config.planner)
    except ValueError as error:
        raise ConfigError(str(error)) from error
    traffic_setup.check(config.virtual_traffic)
    sibling_setup.check(config)
    scenarios_of(config)  # an unknown one is told before anything long begins
    read_layout(config.layout)
    cache = "the cache" if config.cache_dir is None else "cache_dir"
    for name, folder in (("--out", Path(config.out)), (cache, config.worlds_cache)):
        if (trouble := trouble_with_folder(folder)) is not None:
            raise ConfigError(f"{name} {folder}: {trouble}")
    vehicle = load_vehicle(Path(config.vehicle) if config.vehicle else None)
    if config.standin_parameters is not None:
        read_parameters(Path(config.standin_parameters))
    progress = progress_of(config.progress_table)
    anchor = _anchor_for(config.anchor, config.vehicle, first_pose=True)
    if anchor is not None and config.towards_vehicle and not anchor.fence:
        raise ConfigError(f"--anchor {config.anchor}: --towards-vehicle needs its fence")
    ros2 = read_ros2(config)
    sensors = tuple(map(read_sensor, config.sensors))
    check_measured(sensors, ros2)
    if config.secure is not None and config.endpoint is not None:
        check_campaign(Path(config.secure), config.endpoint, car=starts_a_car(config))
    map_file = Path(config.map) if config.map else MAP_FILE
    source = config.resolved_source
    if anchor is not None:
        anchor = with_first_pose(anchor, config, vehicle, ros2)
    info, positions, log_file = None, None, None
    if source == "log":
        log_file = Path(config.log or "")
        lot = None if anchor is None else anchor.anchor
        info, positions = _read_log(config, log_file, lot)
    given = _given_line(config, positions)
    near = positions if positions is not None else given
    clip = None if near is None else Clip(near, CORRIDOR_M)
    opened = open_map(map_file, clip=clip, tides=False)
    # For its errors alone, before anything starts: the process that builds Worlds reads them.
    earlier = tracks_for(opened.osm.bounds, config.tracks)
    osm, graph, junctions = opened.osm, opened.graph, opened.junctions
    index = RoadIndex(graph)
    if positions is not None and log_file is not None:
        _check_in_map(positions, log_file, index, map_file)
    routes, route_source = _routes(config, graph, index, given)
    used = [item for route in routes for item in route.edges]
    added = open_service_roads(graph.edges if config.service_roads else (i.edge for i in used))
    driven = tuple(item.key for item in used)
    # Only now is it known where the route leaves the streets, and which way round it drives.
    fit = opened.with_roads(added).with_tides(driven)
    if fit is not opened:
        opened, graph, junctions, index = fit, fit.graph, fit.junctions, RoadIndex(fit.graph)
        routes, route_source = _routes(config, graph, index, given)
    if config.worlds is not None:
        check_given_worlds(Path(config.worlds), osm, junctions, radius_m=config.radius_m)
    heights = profiles_of(opened, None if config.dem is None else Path(config.dem))
    standin = None
    if source == "standin":
        if len(routes) > 1:
            text = f"the route is {len(routes)} stretches of road that do not join"
            say(f"{text}: the stand-in car drives the first, {routes[0].end_m:.0f} m", error=True)
        real = config.standin_dem
        ground = heights if real is None else profiles_of(opened, Path(real))
        standin = standin_path(osm, graph, routes[0], ground)
    if positions is not None:
        origin = positions[0]
    elif standin is not None:
        origin = np.array([standin.lat_deg[0], standin.lon_deg[0]])
    else:
        origin = np.array([graph.frame.origin.lat_deg, graph.frame.origin.lon_deg])
    drive_frame = LocalFrame(GeoPoint(float(origin[0]), float(origin[1])))
    return DriveInputs(
        config=config,
        map_file=map_file,
        clip=clip,
        osm=osm,
        graph=graph,
        index=index,
        junctions=junctions,
        added_roads=added,
        driven_edges=driven,
        routes=routes,
        route_source=route_source,
        drive_frame=drive_frame,
        slopes=None if heights is None else slopes_in(drive_frame, graph, heights),
        vehicle=vehicle,
        beside=tuple(_read_beside(one, config, vehicle) for one in config.vehicles),
        log_file=log_file,
        info=info,
        standin=standin,
        anchor=anchor,
        ros2=ros2,
        progress=progress,
        sensors=sensors,
        tracks=() if earlier is None else earlier.tracks,
    )


def starts_a_car(config: DriveConfig) -> bool:
    """Whether a process of the drive speaks as a vehicle: a stand-in, a replay or a gateway."""
    gateways = [config.ros2, *(other.ros2 for other in config.vehicles)]
    return config.resolved_source != "live" or any(one is not None for one in gateways)


def _read_log(
    config: DriveConfig, log_file: Path, anchor: Anchor | None
) -> tuple[VehicleInfo, Array]:
    """Return what the log says of itself and where in the World it was (N, 2) between start and
    end."""
    if not log_file.exists():
        raise FileNotFoundError(f"recorded drive {log_file}: no such file or folder")
    log = open_log(log_file)
    try:
        line = line_of_log(log, start_s=config.start_s, end_s=config.end_s)
    except LogError as error:
        end = "its end" if config.end_s is None else f"--end {config.end_s:g}"
        raise UserError(f"{log_file} from --start {config.start_s:g} to {end}: {error}") from error
    if anchor is None:
        return log.info, line.lat_lon_deg
    lat_deg, lon_deg = line.lat_lon_deg.T
    there = anchor.world_from_lot_line(AnchorLine(lat_deg, lon_deg, np.zeros(len(lat_deg))))
    return log.info, np.stack([there.lat_deg, there.lon_deg], axis=1)


def _read_beside(
    config: OtherVehicleConfig, drive: DriveConfig, own: VehicleParameters
) -> OtherVehiclePlan:
    vehicle = own if config.vehicle is None else load_vehicle(Path(config.vehicle))
    kind = config.vehicle or drive.vehicle
    file_on_lot = _anchor_for(config.anchor, kind)
    lot = None if file_on_lot is None else file_on_lot.anchor
    if config.log is None:
        ros2 = read_ros2_beside(config, drive)
        scale = scale_of(kind)
        return OtherVehiclePlan(config, vehicle, config.live, ros2=ros2, lot=lot, scale=scale)
    file = Path(config.log)
    if not file.exists():
        raise FileNotFoundError(f"recorded drive {file} of {config.id}: no such file or folder")
    return OtherVehiclePlan(
        config, vehicle, commands_recorded="control" in open_log(file).info.sends, lot=lot
    )


def _anchor_for(
    file: str | None, vehicle: str | None, *, first_pose: bool = False
) -> AnchorFile | None:
    """Return the anchor that a file holds; ConfigError where its vehicle is of another scale."""
    if file is None:
        return None
    anchor, scale = read_anchor(Path(file), first_pose=first_pose), scale_of(vehicle)
    if anchor.scale != scale:
        raise ConfigError(
            f"anchor {file}: scale = {anchor.scale:g}, but vehicle {vehicle or DEFAULT_FILE.stem} "
            f"is one of scale {scale:g}: lot and car have to be of one size"
        )
    return anchor


def _check_in_map(positions: Array, log_file: Path, index: RoadIndex, map_file: Path) -> None:
    xy = local_from_geo(index.graph.frame, positions[:, 0], positions[:, 1])
    every = max(1, len(xy) // 500)
    if not any(index.near(point, NEAR_ROAD_M) for point in xy[::every]):
        raise UserError(
            f"{map_file}: holds no position of the drive {log_file} (which begins at "
            f"{positions[0, 0]:.5f}, {positions[0, 1]:.5f}); the map covers "
            f"{_bounds_text(index.graph)}"
        )


def _bounds_text(graph: RoadGraph) -> str:
    xy = np.array(list(graph.node_xy_m.values()))
    low, high = geo_from_local(graph.frame, np.stack([xy.min(axis=0), xy.max(axis=0)]))
    return f"{low[0]:.4f},{low[1]:.4f} to {high[0]:.4f},{high[1]:.4f}"


def _given_line(config: DriveConfig, positions: Array | None) -> Array | None:
    """Return the line (N, 2) of degrees that the route shall follow; None: it is predicted."""
    if config.route == "live":
        return None
    if config.route == "from-log":
        return positions
    route_file = config.route
    if route_file is None and config.map is None:
        route_file = str(ROUTE_FILE)
    if route_file is None:
        return None
    return read_route(Path(route_file))


def _routes(
    config: DriveConfig, graph: RoadGraph, index: RoadIndex, given: Array | None
) -> tuple[tuple[Route, ...], str]:
    """Return the given routes, none where the route is predicted, and where they came from."""
    if given is None:
        return (), "live" if config.route == "live" else "predicted"
    from_log = config.route == "from-log"
    what = f"from-log of {config.log}" if from_log else config.route or ROUTE_FILE
    source = "from-log" if from_log else "given"
    return match_line(graph, given, name=f"--route {what}", index=index).routes, source


def make_plan(inputs: DriveInputs, now: datetime.datetime) -> DrivePlan:
    """Create the run's folder and return the plan of the drive; the first write of all."""
    config = inputs.config
    out = Path(config.out)
    run_id = f"{now:%Y%m%d-%H%M%S}-{secrets.token_hex(2)}"
    folder = out / run_id
    for sub in ("worlds", "results", "processes"):
        (folder / sub).mkdir(parents=True, exist_ok=sub != "worlds")
    live: str = "none" if config.view == "copilot" else config.view
    if live == "auto":
        live = "native" if has_display() else "none"
    plan = DrivePlan(
        **{name: getattr(inputs, name) for name in DriveInputs.__dataclass_fields__},
        run_id=run_id,
        folder=folder.resolve(),
        bus=BusSetup(
            endpoint=config.endpoint or "",
            lossless=config.lock_step,
            tls=None if config.secure is None else role_files(Path(config.secure), "orchestrator"),
        ),
        live_view=live,
        page_port=free_or(WEB_PORT),
        copilot_port=free_or(USUAL_PORT) if config.view == "copilot" else None,
    )
    try:
        if plan.standin is not None:
            plan.standin_path_file.write_text(json.dumps(plan.standin.as_json()), encoding="utf-8")
        if plan.anchor is not None:
            (folder / "anchor.toml").write_text(anchor_text(plan.anchor), encoding="utf-8")
        if plan.slopes is not None:
            write_message(plan.slopes, plan.slopes_file)
        write_message(roads_shown(plan.graph, plan.routes, plan.drive_frame), plan.roads_file)
    except OSError:
        shutil.rmtree(folder)
        raise
    return plan
