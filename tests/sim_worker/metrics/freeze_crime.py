"""Compute what commonroad-crime says of ten scenes, and keep it as JSON beside the scenes.

Run once, in an environment of its own; nothing else here needs that package:

    python -m venv VENV && VENV/bin/pip install commonroad-crime==0.4.5
    VENV/bin/python tests/sim_worker/metrics/freeze_crime.py tests/data/metrics/crime.json

Following takes place on a straight lane along x. Where two ways cross, both lanes are as wide as
their vehicles, since the package takes the lanes' common ground for what we take from the vehicles.
Its delta-v is not asked for: it adds the speeds of who drive the same way.
"""

from __future__ import annotations

import importlib.metadata
import itertools
import json
import math
import sys
from pathlib import Path

import numpy as np
from commonroad.geometry.shape import Rectangle
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.intersection import Intersection, IntersectionIncomingElement
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario, ScenarioID, Tag
from commonroad.scenario.state import CustomState, InitialState
from commonroad.scenario.trajectory import Trajectory
from commonroad_crime.data_structure.configuration import CriMeConfiguration
from commonroad_crime.measure import HW, PET, THW, TTC, ALatReq, ALongReq, AReq

STEP_S, UNTIL_S = 0.02, 8.0
EGO, OTHER = 1, 2
TILT = 1e-4
"""A lane along x exactly has the orientation 0, which the package takes for unknown."""
EGO_SIZE_M = (4.6, 1.8)

# The middles of the boxes at time 0, yaw, speed and acceleration along it, length and width.
SCENES = {
    "slower_leader": {"ego": (0, 0, 0, 15, 0), "other": (40, 0, 0, 10, 0, 4.5, 1.8)},
    "faster_leader": {"ego": (0, 0, 0, 10, 0), "other": (25, 0, 0, 14, 0, 4.5, 1.8)},
    "same_speed": {"ego": (0, 0, 0, 12, 0), "other": (20, 0, 0, 12, 0, 4.5, 1.8)},
    "standing_leader": {"ego": (0, 0, 0, 9, 0), "other": (35, 0, 0, 0, 0, 4.5, 1.8)},
    "accelerating_leader": {"ego": (0, 0, 0, 16, 0), "other": (22, 0, 0, 8, 0.6, 4.5, 1.8)},
    "long_leader": {"ego": (0, 0, 0, 13.3, 0), "other": (41, 0, 0, 7.1, 0, 16.5, 2.5)},
    "slow_bicycle": {"ego": (0, 0, 0, 8.3, 0), "other": (18, 0, 0, 4.2, 0, 1.8, 0.6)},
    "motorway": {"ego": (0, 0, 0, 33, 0), "other": (70, 0, 0, 22, 0, 4.5, 1.8)},
    "crosses_behind": {
        "ego": (-20, 0, 0, 10, 0),
        "other": (0, -36, math.pi / 2, 9, 0, 4.2, 2.0),
        "crossing": True,
    },
    "crosses_before": {
        "ego": (-45, 0, 0, 11, 0),
        "other": (0, -18, math.pi / 2, 8, 0, 5.0, 2.2),
        "crossing": True,
    },
}


def main(out: Path) -> None:
    versions = {
        name: importlib.metadata.version(name) for name in ("commonroad-crime", "commonroad-io")
    }
    rows = {}
    for name, scene in SCENES.items():
        measures = (PET,) if "crossing" in scene else (HW, TTC, THW, ALongReq, ALatReq, AReq)
        found = {m.__name__: measured(m, scene) for m in measures}
        rows[name] = {**scene, "ego_size_m": EGO_SIZE_M, "found": found}
        print(name, found)
    kept = {"versions": versions, "step_s": STEP_S, "until_s": UNTIL_S, "scenes": rows}
    out.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


def measured(measure: type, scene: dict) -> float | None:
    config = CriMeConfiguration()
    config.update(ego_id=EGO, sce=scenario(scene))
    # Both keep their acceleration; the other mode is about who stops before.
    config.acceleration.acceleration_mode = 1
    value = measure(config).compute(time_step=0, vehicle_id=OTHER)
    return None if value is None or not math.isfinite(value) else float(value)


def scenario(scene: dict) -> Scenario:
    made = Scenario(STEP_S, ScenarioID.from_benchmark_id("DEU_Drawn-1_1_T-1", "2020a"))
    x, y, yaw, speed, accel, length, width = scene["other"]
    if scene.get("crossing"):
        made.tags = {Tag.INTERSECTION}
        lanes = [
            *three_lanes(100, np.array([1.0, 0.0]), EGO_SIZE_M[1]),
            *three_lanes(200, np.array([0.0, 1.0]), width),
        ]
        incomings = [
            IntersectionIncomingElement(301, incoming_lanelets={100}, successors_straight={101}),
            IntersectionIncomingElement(302, incoming_lanelets={200}, successors_straight={201}),
        ]
        network = LaneletNetwork.create_from_lanelet_list(lanes)
        network.add_intersection(Intersection(300, incomings))
    else:
        network = LaneletNetwork.create_from_lanelet_list(
            [lane(100, np.array([-50.0, 0.0]), np.array([450.0, 450.0 * TILT]), 3.5)]
        )
    made.add_objects(network)
    made.add_objects(vehicle(EGO, *scene["ego"], *EGO_SIZE_M, network))
    made.add_objects(vehicle(OTHER, x, y, yaw, speed, accel, length, width, network))
    made.assign_obstacles_to_lanelets()
    return made


def three_lanes(first: int, way: np.ndarray, width: float) -> list[Lanelet]:
    """Into the junction, through it and out of it."""
    ends = (-120.0, -8.0, 8.0, 120.0)
    lanes = [lane(first + k, ends[k] * way, ends[k + 1] * way, width) for k in range(3)]
    for before, after in itertools.pairwise(lanes):
        before.add_successor(after.lanelet_id)
        after.add_predecessor(before.lanelet_id)
    return lanes


def lane(number: int, begin: np.ndarray, end: np.ndarray, width: float) -> Lanelet:
    share = np.linspace(0.0, 1.0, 101)[:, None]
    middle = begin + share * (end - begin)
    way = (end - begin) / np.hypot(*(end - begin))
    left = np.array([-way[1], way[0]]) * width / 2.0
    return Lanelet(middle + left, middle, middle - left, number)


def vehicle(
    number: int,
    x: float,
    y: float,
    yaw: float,
    speed: float,
    accel: float,
    length: float,
    width: float,
    network: LaneletNetwork,
) -> DynamicObstacle:
    shape = Rectangle(length, width)
    states = []
    for step in range(round(UNTIL_S / STEP_S) + 1):
        t = step * STEP_S
        way = speed * t + accel * t * t / 2.0
        along = speed + accel * t
        states.append(
            {
                "time_step": step,
                "position": np.array([x + way * math.cos(yaw), y + way * math.sin(yaw)]),
                "orientation": yaw,
                "velocity": along,
                "acceleration": accel,
            }
        )
    first = InitialState(**states[0], yaw_rate=0.0, slip_angle=0.0)
    trajectory = Trajectory(1, [CustomState(**state) for state in states[1:]])
    lanes = {
        state["time_step"]: set(network.find_lanelet_by_position([state["position"]])[0])
        for state in states
    }
    prediction = TrajectoryPrediction(trajectory, shape, center_lanelet_assignment=lanes)
    return DynamicObstacle(number, ObstacleType.CAR, shape, first, prediction)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
