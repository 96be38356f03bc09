"""Compute what commonroad-crime says of twenty-two scenes, and write it as JSON beside the scenes.

It runs in an environment of its own; nothing else here needs that package (BSD 3-clause):

    python -m venv VENV && VENV/bin/pip install commonroad-crime==0.4.5
    VENV/bin/python tests/sim_worker/metrics/freeze_crime.py tests/data/metrics/crime.json

Where two ways cross, both lanes are as wide as their vehicles, since the package takes the lanes'
common ground for what we take from the vehicles. What the car can do is set to what foretwin takes.
For its worst time to collision vehicles are made thrice as long, since it takes the disc around a
third of them. Not asked for are its delta-v, which adds the speeds of who drive the same way; its
distances in bends, where it takes speeds along x whichever way the lane leads; and time to steer,
which it finds for none of these scenes, a lane's edge being a wall to it.
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
from commonroad_crime.measure import (
    BTN,
    ET,
    HW,
    PET,
    PSD,
    STN,
    THW,
    TTB,
    TTC,
    WTTC,
    ALatReq,
    ALongReq,
    AReq,
    TTCStar,
)

STEP_S, UNTIL_S = 0.02, 8.0
EGO, OTHER = 1, 2
TILT = 1e-4
"""A lane along x exactly has the orientation 0, which the package takes for unknown."""
EGO_SIZE_M = (4.6, 1.8)
MAX_ACCEL_MPS2, STOPPING_DECEL_MPS2 = 8.0, 3.4
"""`driver_model.MAX_DECEL_MPS2`, `encroachment.STOPPING_DECEL_MPS2`."""
FOLLOWING = (HW, TTC, THW, ALongReq, ALatReq, AReq, BTN, STN, WTTC, TTCStar, TTB)
CROSSING = (PET, ET, PSD, WTTC, TTCStar)
BENDS = (WTTC, TTCStar)

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
    **{
        f"crosses_at_{degrees}_{name}": {
            "ego": (-ego_away, 0, 0, ego_mps, 0),
            "other": (
                -away * math.cos(math.radians(exactly)),
                -away * math.sin(math.radians(exactly)),
                math.radians(exactly), mps, 0, 4.4, 1.9,
            ),
            "crossing": True,
        }
        # At 60° exactly the package fails an assertion of its own.
        for degrees, exactly in ((45, 45.0), (60, 60.1), (90, 90.0), (135, 135.0))
        for name, ego_away, ego_mps, away, mps in (
            ("and_hits", 30, 9, 30.13, 9.3),
            ("and_passes", 44, 9.5, 21.13, 8),
        )
    },
    # In bends: along the arc ahead, 1 / radius to the left, speed of both.
    **{
        name: {
            "ego": (0, 0, 0, ego_mps, 0),
            "other": (ahead, 0, 0, mps, 0, 4.5, 1.8),
            "bend_pm": bend_pm,
        }
        for name, ego_mps, ahead, mps, bend_pm in (
            ("bend_left", 12, 30, 6, 1 / 50),
            ("bend_right", 10, 25, 5, -1 / 35),
            ("stands_in_bend", 9, 28, 0, 1 / 40),
            ("wide_bend", 20, 60, 9, -1 / 150),
        )
    },
}  # fmt: skip


def main(out: Path) -> None:
    versions = {
        name: importlib.metadata.version(name) for name in ("commonroad-crime", "commonroad-io")
    }
    rows = {}
    for name, scene in SCENES.items():
        crossing, bend = "crossing" in scene, "bend_pm" in scene
        measures = CROSSING if crossing else BENDS if bend else FOLLOWING
        found = {m.__name__: measured(m, scene) for m in measures}
        rows[name] = {**scene, "ego_size_m": EGO_SIZE_M, "found": found}
        print(name, found)
    kept = {"versions": versions, "step_s": STEP_S, "until_s": UNTIL_S, "scenes": rows}
    out.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


def measured(measure: type, scene: dict) -> float | None:
    config = CriMeConfiguration()
    # Off its lane a car is in a wall for the time to collision along trajectories.
    made = scenario(scene, length=3.0 if measure is WTTC else 1.0, wide=measure is TTCStar)
    config.update(ego_id=EGO, sce=made)
    # Both keep their acceleration; the other mode is about who stops before.
    config.acceleration.acceleration_mode = 1
    limit = STOPPING_DECEL_MPS2 if measure is PSD else MAX_ACCEL_MPS2
    can = config.vehicle
    can.curvilinear.a_lon_max, can.curvilinear.a_lon_min = limit, -limit
    can.curvilinear.a_lat_max, can.curvilinear.a_lat_min = MAX_ACCEL_MPS2, -MAX_ACCEL_MPS2
    can.params.longitudinal.a_max = MAX_ACCEL_MPS2
    for axis in "xy":
        setattr(can.cartesian, f"a_{axis}_max", MAX_ACCEL_MPS2)
        setattr(can.cartesian, f"a_{axis}_min", -MAX_ACCEL_MPS2)
        setattr(can.cartesian, f"j_{axis}_max", 1e6)
        setattr(can.cartesian, f"j_{axis}_min", -1e6)
    for_all = measure in (TTCStar, TTB)
    try:
        value = measure(config).compute(time_step=0, **({} if for_all else {"vehicle_id": OTHER}))
    except Exception as error:  # whatever it is, it has no answer
        print(measure.__name__, "fails:", repr(error)[:200])
        return None
    return None if value is None or not math.isfinite(value) else float(value)


def scenario(scene: dict, *, length: float, wide: bool) -> Scenario:
    made = Scenario(STEP_S, ScenarioID.from_benchmark_id("DEU_Drawn-1_1_T-1", "2020a"))
    *motion, other_length, width = scene["other"]
    if scene.get("crossing"):
        made.tags = {Tag.INTERSECTION}
        lanes = [
            *three_lanes(100, np.array([1.0, 0.0]), 9.0 if wide else EGO_SIZE_M[1]),
            *three_lanes(
                200,
                np.array([math.cos(motion[2]), math.sin(motion[2])]),
                9.0 if wide else width,
            ),
        ]
        incomings = [
            IntersectionIncomingElement(301, incoming_lanelets={100}, successors_straight={101}),
            IntersectionIncomingElement(302, incoming_lanelets={200}, successors_straight={201}),
        ]
        network = LaneletNetwork.create_from_lanelet_list(lanes)
        network.add_intersection(Intersection(300, incomings))
    else:
        middle = np.array([[x, TILT * x] for x in np.linspace(-50.0, 450.0, 501)])
        if "bend_pm" in scene:
            middle = np.array(
                [on_bend(x, scene["bend_pm"])[:2] for x in np.linspace(-30, 110, 281)]
            )
        network = LaneletNetwork.create_from_lanelet_list([lane(100, middle, 9.0 if wide else 3.5)])
    made.add_objects(network)
    bend = scene.get("bend_pm", 0.0)
    ego_length, ego_width = EGO_SIZE_M
    made.add_objects(vehicle(EGO, scene["ego"], (length * ego_length, ego_width), bend, network))
    made.add_objects(vehicle(OTHER, motion, (length * other_length, width), bend, network))
    made.assign_obstacles_to_lanelets()
    return made


def three_lanes(first: int, way: np.ndarray, width: float) -> list[Lanelet]:
    """Into the junction, through it and out of it."""
    ends = (-120.0, -8.0, 8.0, 120.0)
    lanes = [
        lane(first + k, np.linspace(ends[k], ends[k + 1], 101)[:, None] * way, width)
        for k in range(3)
    ]
    for before, after in itertools.pairwise(lanes):
        before.add_successor(after.lanelet_id)
        after.add_predecessor(before.lanelet_id)
    return lanes


def lane(number: int, middle: np.ndarray, width: float) -> Lanelet:
    way = np.gradient(middle, axis=0)
    way /= np.hypot(way[:, :1], way[:, 1:])
    left = np.column_stack([-way[:, 1], way[:, 0]]) * width / 2.0
    return Lanelet(middle + left, middle, middle - left, number)


def on_bend(along: float, bend_pm: float) -> tuple[float, float, float]:
    """Where and whither on a lane that begins along x and bends with 1 / radius."""
    angle = along * bend_pm
    if not bend_pm:
        return along, 0.0, 0.0
    return math.sin(angle) / bend_pm, (1.0 - math.cos(angle)) / bend_pm, angle


def vehicle(
    number: int, motion: tuple, size: tuple[float, float], bend_pm: float, network: LaneletNetwork
) -> DynamicObstacle:
    x, y, yaw, speed, accel = motion
    shape = Rectangle(*size)
    states = []
    for step in range(round(UNTIL_S / STEP_S) + 1):
        t = step * STEP_S
        way = speed * t + accel * t * t / 2.0
        at = x + way * math.cos(yaw), y + way * math.sin(yaw), yaw
        if bend_pm:
            at = on_bend(x + way, bend_pm)
        states.append(
            {
                "time_step": step,
                "position": np.array(at[:2]),
                "orientation": at[2],
                "velocity": speed + accel * t,
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
