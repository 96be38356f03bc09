"""foretwin: a low-fidelity digital twin that drives ahead of a real car.

What a notebook needs, each name loaded when it is first used:

    import foretwin

    town = foretwin.open_map("town.osm")  # or foretwin.drawn_town()
    world = town.world(town.intersections[0].id)
    way = foretwin.ways_through(world)[0]
    futures = foretwin.run_futures(world, way, foretwin.state_on(world, way), count=32)
    futures.table["progress_m"]  # and "min_clearance_m", where others come near

Metres, seconds, radians; x east, y north in a World's own frame, yaw counter-clockwise from east.
A car's pose is that of its rear axle's centre on the ground. Mistakes in what is given are
`UserError`, in one line. `foretwin.bus` is what a program beside foretwin speaks on its bus with.

The rooms (`foretwin.contracts`, `foretwin.world_gen` and so on) stand at the top level of the
repository; the links beside this file let an editable install find them under this name.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from foretwin.contracts.drive import VehicleState
    from foretwin.contracts.errors import UserError
    from foretwin.contracts.futures import Future
    from foretwin.contracts.scenario import Scenario
    from foretwin.contracts.vehicle import VehicleParameters
    from foretwin.contracts.world import World
    from foretwin.maps import (
        Map,
        drawn_town,
        export_formats,
        export_world,
        open_map,
        read_world,
        save_world,
    )
    from foretwin.orchestrator.occurred.occurred import occurred_in
    from foretwin.plots import (
        plot_driven,
        plot_futures,
        plot_gap,
        plot_junction,
        plot_outcomes,
    )
    from foretwin.recordings import MotionArrays, Recording, open_run, open_sweep
    from foretwin.sensing import (
        camera_view,
        lidar_scan,
        merge_clouds,
        motion_samples,
        radar_list,
        road_user,
        save_clouds,
        save_pictures,
        save_radar_lists,
        save_samples,
    )
    from foretwin.sim_worker.gym import JunctionEnv as JunctionEnv
    from foretwin.sim_worker.gym import JunctionVectorEnv as JunctionVectorEnv
    from foretwin.sim_worker.planner_interface import Planner, PlannerOutput, PlannerView
    from foretwin.sim_worker.planners.one_at_a_time import CarView
    from foretwin.sim_worker.planners.registry import planner_names
    from foretwin.sim_worker.planners.tracking import pure_pursuit
    from foretwin.sim_worker.scenarios.reading import catalogue, find_scenario, read_scenario
    from foretwin.sim_worker.scenarios.ways import Way
    from foretwin.sim_worker.vehicle.parameters import load_vehicle
    from foretwin.sim_worker.vehicle.reference_points import front_from_base_m
    from foretwin.simulation import Futures, run_futures, state_on, ways_through

_MAPS = "Map", "drawn_town", "export_formats", "export_world", "open_map"
_PLOTS = "plot_driven", "plot_futures", "plot_gap", "plot_junction", "plot_outcomes"
_FROM = {
    "foretwin.contracts.drive": ("VehicleState",),
    "foretwin.contracts.errors": ("UserError",),
    "foretwin.contracts.futures": ("Future",),
    "foretwin.contracts.scenario": ("Scenario",),
    "foretwin.contracts.vehicle": ("VehicleParameters",),
    "foretwin.contracts.world": ("World",),
    "foretwin.maps": (*_MAPS, "read_world", "save_world"),
    "foretwin.orchestrator.occurred.occurred": ("occurred_in",),
    "foretwin.plots": _PLOTS,
    "foretwin.recordings": ("MotionArrays", "Recording", "open_run", "open_sweep"),
    "foretwin.sensing": (
        "camera_view",
        "lidar_scan",
        "merge_clouds",
        "motion_samples",
        "radar_list",
        "road_user",
        "save_clouds",
        "save_pictures",
        "save_radar_lists",
        "save_samples",
    ),
    "foretwin.sim_worker.gym": ("JunctionEnv", "JunctionVectorEnv"),
    "foretwin.sim_worker.planner_interface": ("Planner", "PlannerOutput", "PlannerView"),
    "foretwin.sim_worker.planners.one_at_a_time": ("CarView",),
    "foretwin.sim_worker.planners.registry": ("planner_names",),
    "foretwin.sim_worker.planners.tracking": ("pure_pursuit",),
    "foretwin.sim_worker.scenarios.reading": ("catalogue", "find_scenario", "read_scenario"),
    "foretwin.sim_worker.scenarios.ways": ("Way",),
    "foretwin.sim_worker.vehicle.parameters": ("load_vehicle",),
    "foretwin.sim_worker.vehicle.reference_points": ("front_from_base_m",),
    "foretwin.simulation": ("Futures", "run_futures", "state_on", "ways_through"),
}
_MODULE_OF = {name: module for module, names in _FROM.items() for name in names}

# Without the environments: they need an extra, and `import *` would fail where it is missing.
__all__ = ["CarView", "Future", "Futures", "Map", "MotionArrays", "Planner"]
__all__ += ["PlannerOutput", "PlannerView", "Recording", "Scenario", "UserError"]
__all__ += ["VehicleParameters", "VehicleState", "Way", "World", "catalogue", "drawn_town"]
__all__ += ["export_formats", "export_world", "find_scenario", "front_from_base_m", "load_vehicle"]
__all__ += [
    "occurred_in",
    "open_map",
    "open_run",
    "open_sweep",
    "planner_names",
    "pure_pursuit",
    "read_scenario",
]
__all__ += ["plot_driven", "plot_futures", "plot_gap", "plot_junction", "plot_outcomes"]
__all__ += ["lidar_scan", "merge_clouds", "read_world", "road_user", "run_futures", "save_clouds"]
__all__ += ["camera_view", "motion_samples", "radar_list", "save_pictures", "save_radar_lists"]
__all__ += ["save_samples"]
__all__ += ["save_world", "state_on", "ways_through"]


def __getattr__(name: str) -> Any:
    """Load a name of the face on first use: importing one room must not load the others."""
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'foretwin' has no attribute {name!r}")
    value = getattr(import_module(_MODULE_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(_MODULE_OF)
