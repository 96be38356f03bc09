"""What MetaDrive 0.3.0.1 reaches; run by the interpreter of an environment that has it.

    python metadrive_drive.py ROAD_USERS SECONDS

Drives by MetaDrive's own driver model among that many moving road users, with nothing rendered and
no lidar. For each line on standard input it drives on for SECONDS and prints the simulated seconds
per CPU second; an episode that ends is begun anew off the clock.
"""

from __future__ import annotations

import sys
import time

from metadrive.envs import MetaDriveEnv
from metadrive.policy.idm_policy import IDMPolicy

STEP_S = 0.1
"""Five physics steps of 20 ms, MetaDrive's own default."""


def environment() -> MetaDriveEnv:
    env = MetaDriveEnv(
        {
            "map": "SXSXS", "traffic_density": 0.4, "traffic_mode": "respawn",
            "agent_policy": IDMPolicy, "start_seed": 5, "environment_num": 1,
            "use_render": False, "vehicle_config": {"lidar": {"num_lasers": 0, "num_others": 0}},
        }
    )  # fmt: skip
    env.reset()
    return env


def begin(env: MetaDriveEnv, road_users: int) -> None:
    """Reset, and keep so many of MetaDrive's road users."""
    env.reset()
    manager = env.engine.traffic_manager
    others = manager._traffic_vehicles
    if len(others) < road_users:
        raise SystemExit(f"MetaDrive puts {len(others)} on this road, {road_users} were asked for")
    manager.clear_objects([vehicle.id for vehicle in others[road_users:]])
    del others[road_users:]


def drive(env: MetaDriveEnv, *, road_users: int, seconds: float) -> float:
    """Return simulated seconds per CPU second of one pass."""
    taken = 0.0
    for _ in range(round(seconds / STEP_S)):
        start = time.process_time()
        done = env.step([0.0, 0.0])[2]
        taken += time.process_time() - start
        if done:
            begin(env, road_users)
    return seconds / taken


def main(road_users: int, seconds: float) -> None:
    env = environment()
    begin(env, road_users)
    drive(env, road_users=road_users, seconds=1.0)
    print("ready", flush=True)
    for _ in sys.stdin:
        print(drive(env, road_users=road_users, seconds=seconds), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]))
