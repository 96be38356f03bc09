"""Let the published PDM scorer of NAVSIM v2 score scenes, part by part: JSON in, JSON out.

It runs in an environment of its own with numpy, pandas, scipy and shapely, on checkouts of
autonomousvision/navsim and motional/nuplan-devkit (Apache 2.0), of which nothing is copied here:

    VENV/bin/python tests/sim_worker/metrics/judge_navsim.py NAVSIM NUPLAN < scenes > parts

The scorer, its maps, paths and comfort are theirs. Stand-ins below are given for the types of
nuPlan that hold a pose or a name, and for the recording that says where others are.
"""

from __future__ import annotations

import ast
import enum
import importlib.abc
import importlib.machinery
import json
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import shapely

PLANNER = "navsim.planning.simulation.planner.pdm_planner"
IDM_UTILS = "nuplan/planning/simulation/observation/idm/utils.py"
IDM_FUNCTIONS = (
    "get_agent_relative_angle", "is_agent_ahead", "is_agent_behind", "is_track_stopped",
)  # fmt: skip
RED = "red_light"


class Pose:
    def __init__(self, x: float, y: float, heading: float) -> None:
        self.x, self.y, self.heading = x, y, heading

    @property
    def point(self) -> Pose:
        return self


class Layer(enum.IntEnum):
    LANE, INTERSECTION, LANE_CONNECTOR, ROADBLOCK = range(4)
    ROADBLOCK_CONNECTOR, DRIVABLE_AREA, CARPARK_AREA = range(4, 7)


class Collision(enum.IntEnum):
    STOPPED_EGO_COLLISION, STOPPED_TRACK_COLLISION, ACTIVE_FRONT_COLLISION = range(3)
    ACTIVE_REAR_COLLISION, ACTIVE_LATERAL_COLLISION = range(3, 5)


class Agent:
    """A road user as the scorer asks for it."""

    def __init__(self, heading: float, speed_mps: float) -> None:
        self.box = types.SimpleNamespace(center=types.SimpleNamespace(heading=heading))
        self.velocity = types.SimpleNamespace(magnitude=lambda: speed_mps)
        self.tracked_object_type = "vehicle"


class StandIns(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Whatever of nuPlan and of the rest of NAVSIM is imported and not given is an empty name."""

    REAL = (f"{PLANNER}.scoring", f"{PLANNER}.utils", f"{PLANNER}.observation.pdm_occupancy_map")

    def find_spec(self, name: str, path: object = None, target: object = None) -> object:
        real = name.startswith(self.REAL)
        outside = name.split(".")[0] in ("nuplan", "navsim")
        package = any(kept.startswith(name) for kept in self.REAL)
        if real or not outside or package:
            return None
        return importlib.machinery.ModuleSpec(name, self, is_package=True)

    def create_module(self, spec: object) -> None:
        return None

    def exec_module(self, module: types.ModuleType) -> None:
        module.__dict__["__getattr__"] = self._answer
        given = {
            "nuplan.common.actor_state.state_representation": {"StateSE2": Pose},
            "nuplan.common.maps.maps_datatypes": {"SemanticMapLayer": Layer},
            "nuplan.planning.metrics.utils.collision_utils": {"CollisionType": Collision},
            "nuplan.common.actor_state.tracked_objects_types": {"AGENT_TYPES": {"vehicle"}},
            "nuplan.planning.simulation.observation.idm.utils": IDM,
            "navsim.common.dataclasses": {"PDMResults": lambda **parts: parts},
            "nuplan.common.actor_state.vehicle_parameters": {
                "get_pacifica_parameters": lambda: VEHICLE,
                "VehicleParameters": object,
            },
        }
        module.__dict__.update(given.get(module.__name__, {}))

    @staticmethod
    def _answer(name: str) -> type:
        if name.startswith("__"):
            raise AttributeError(name)
        return type(name, (), {})


class Others:
    """Where others are at each instant, as the scorer's recording."""

    red_light_token = RED

    def __init__(self, scene: dict[str, Any], occupancy: Any) -> None:
        users, sizes = np.array(scene["users"]), np.array(scene["user_size_m"])
        self.unique_objects = {
            str(k): Agent(users[0, k, 2], scene["user_speed_mps"][k]) for k in range(len(sizes))
        }
        self._maps = []
        for at in range(users.shape[0]):
            boxes = {str(k): box(*users[at, k], *sizes[k]) for k in range(len(sizes))}
            boxes.update(
                {f"{RED}_{k}": shapely.Polygon(area) for k, area in enumerate(scene["red"])}
            )
            self._maps.append(occupancy(list(boxes), np.array(list(boxes.values()), dtype=object)))
        states = np.array(scene["states"])
        half = VEHICLE.half_length, VEHICLE.half_width
        start = states[0, 0, :3]
        ahead = VEHICLE.rear_axle_to_center
        middle = start[:2] + ahead * np.array([np.cos(start[2]), np.sin(start[2])])
        first = self._maps[0].query(box(*middle, start[2], 2 * half[0], 2 * half[1]), "intersects")
        tokens = [self._maps[0].tokens[k] for k in first]
        self.collided_track_ids = [token for token in tokens if not token.startswith(RED)]

    def __getitem__(self, at: int) -> Any:
        return self._maps[at]


def box(x: float, y: float, yaw: float, length: float, width: float) -> shapely.Polygon:
    ahead = np.array([np.cos(yaw), np.sin(yaw)]) * length / 2.0
    left = np.array([-np.sin(yaw), np.cos(yaw)]) * width / 2.0
    corners = [a * ahead + b * left for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    return shapely.Polygon(np.array([x, y]) + corners)


def idm_functions(nuplan: Path) -> dict[str, Any]:
    """Return the functions of nuPlan that tell who is ahead, behind, or stands."""
    tree = ast.parse((nuplan / IDM_UTILS).read_text(encoding="utf-8"))
    kept = [
        node
        for node in tree.body
        if isinstance(node, ast.FunctionDef) and node.name in IDM_FUNCTIONS
    ]
    for node in kept:
        node.decorator_list = []
    names: dict[str, Any] = {"np": np, "npt": np.typing, "Agent": Agent}
    code = ast.Module([*tree.body[:1], *kept], type_ignores=[])
    future = ast.parse("from __future__ import annotations").body
    exec(compile(ast.Module([*future, *code.body[1:]], []), IDM_UTILS, "exec"), names)
    return {name: names[name] for name in IDM_FUNCTIONS}


def main(given: dict[str, Any]) -> dict[str, Any]:
    vectorized = types.ModuleType("shapely.vectorized")
    vectorized.contains = shapely.contains_xy  # type: ignore[attr-defined]
    sys.modules["shapely.vectorized"] = vectorized
    shapely.vectorized = vectorized  # type: ignore[attr-defined]
    from navsim.planning.simulation.planner.pdm_planner.observation.pdm_occupancy_map import (
        PDMDrivableMap,
        PDMOccupancyMap,
    )
    from navsim.planning.simulation.planner.pdm_planner.scoring.pdm_comfort_metrics import (
        ego_is_comfortable,
    )
    from navsim.planning.simulation.planner.pdm_planner.scoring.pdm_scorer import PDMScorer
    from navsim.planning.simulation.planner.pdm_planner.utils.pdm_path import PDMPath

    kinds = [Layer[kind] for kind in given["map"]["kinds"]]
    areas = np.array([shapely.Polygon(*area) for area in given["map"]["areas"]], dtype=object)
    drivable = PDMDrivableMap(given["map"]["tokens"], kinds, areas)
    path = PDMPath([Pose(*point) for point in given["path"]])
    found = {}
    for name, scene in given["scenes"].items():
        states = np.array(scene["states"])
        sampling = types.SimpleNamespace(num_poses=states.shape[1] - 1, interval_length=0.1)
        scorer = PDMScorer(sampling, vehicle_parameters=VEHICLE)
        scores = scorer.score_proposals(
            states, Others(scene, PDMOccupancyMap), path, given["map"]["route"], drivable
        )
        comfort = ego_is_comfortable(states, 0.1 * np.arange(states.shape[1]), VEHICLE)
        found[name] = [
            {
                **{part: float(np.ravel(value)[0]) for part, value in row.items()
                   if not part.startswith("weighted")},
                "history_comfort": float(kept.all()),
                "progress_m": float(metres),
            }
            for row, kept, metres in zip(
                (frame.iloc[0].to_dict() for frame in scores), comfort, scorer._progress_raw,
                strict=True,
            )
        ]  # fmt: skip
    return found


if __name__ == "__main__":
    read = json.load(sys.stdin)
    VEHICLE = types.SimpleNamespace(**read["vehicle"])
    IDM = idm_functions(Path(sys.argv[2]))
    sys.path.insert(0, sys.argv[1])
    sys.meta_path.insert(0, StandIns())
    json.dump(main(read), sys.stdout)
