"""A driving stack for tests: `python -m tests.sim_worker.planners.a_stack HOW [MARK]`.

It drives straight on, or does what HOW says; MARK is a file that it leaves where it does so once.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import msgspec
import numpy as np

from foretwin.bus import PlannedMotions, PlannerScene, ZenohBus, serve_planner
from foretwin.contracts.planner_link import PlannerJoined
from foretwin.contracts.planner_serving import LINK_GIVEN, GivenLink

TIME_S = np.linspace(0.0, 3.0, 31)
SLOW_S = 0.048
HANGS_FOR_S = 600.0


def straight_on(scene: PlannerScene, speed_mps: float = 6.0) -> PlannedMotions:
    """Drive on as each car is headed, at one speed."""
    yaw = scene.states[:, 2:3]
    x = scene.states[:, :1] + np.cos(yaw) * speed_mps * TIME_S
    y = scene.states[:, 1:2] + np.sin(yaw) * speed_mps * TIME_S
    return PlannedMotions(
        job=scene.job, question=scene.question, futures=scene.futures, time_s=TIME_S,
        xy_m=np.stack([x, y], axis=-1), yaw_rad=np.broadcast_to(yaw, x.shape).copy(),
        speed_mps=np.full_like(x, speed_mps),
    )  # fmt: skip


class Remembers:
    """Drives the faster the longer it was asked, from a speed that its future's seed gives."""

    def __init__(self) -> None:
        self._seed = self._asked = 0

    def reset(self, scene: PlannerScene) -> None:
        (self._seed,) = scene.seeds
        self._asked = 0

    def plan(self, scene: PlannerScene) -> PlannedMotions:
        self._asked += 1
        return straight_on(scene, 3.0 + self._seed % 5 + 0.02 * self._asked)


class Odd:
    """Does once, or always, what its name says, at the fifth question of a future."""

    def __init__(self, how: str, mark: Path | None) -> None:
        self._how, self._mark = how, mark

    def plan(self, scene: PlannerScene) -> PlannedMotions:
        answer = straight_on(scene)
        if self._how == "slow":
            end = time.thread_time() + SLOW_S
            while time.thread_time() < end:
                pass
        if scene.question < 5 or (self._mark is not None and self._mark.exists()):
            return answer
        if self._mark is not None:
            self._mark.touch()
        match self._how:
            case "hangs":
                time.sleep(HANGS_FOR_S)
            case "hangs_for_the_second" if 1 in scene.futures:
                time.sleep(HANGS_FOR_S)
            case "dies":
                print("the sky is falling", file=sys.stderr, flush=True)
                os._exit(3)
            case "talks":
                talk_on(answer)
            case "raises":
                raise ValueError("no way\nto go")
            case "shapes":
                return msgspec.structs.replace(answer, yaw_rad=np.zeros((1, 7)))
            case "no_number" if 0 in scene.futures:
                answer.speed_mps[scene.futures.index(0)] = np.nan
            case "leaves_out":
                return straight_on(only(scene, 0))
            case "ends":
                return msgspec.structs.replace(answer, time_s=0.01 * TIME_S)
            case "garbage":
                spoil(b"rubbish")
        return answer


def only(scene: PlannerScene, row: int) -> PlannerScene:
    """Return a scene of one of its futures."""
    return msgspec.structs.replace(
        scene, futures=scene.futures[row : row + 1], states=scene.states[row : row + 1]
    )


def spoil(data: bytes) -> None:
    """Say something that is no message, as whoever has no foretwin to speak with."""
    link = msgspec.json.decode(os.environ[LINK_GIVEN], type=GivenLink)
    with ZenohBus(link.bus) as bus:
        where = f"foretwin/v1/run/{link.run_id}/worker/{link.process_id}/planned_motions"
        bus._session.put(where, data)


def talk_on(answer: PlannedMotions) -> None:
    """Say for ever what nobody has asked."""
    link = msgspec.json.decode(os.environ[LINK_GIVEN], type=GivenLink)
    old = msgspec.structs.replace(answer, question=0)
    with ZenohBus(link.bus) as bus:
        while True:
            bus.publish("planned_motions", old, run=link.run_id, process=link.process_id)
            time.sleep(0.001)


def join_as(version: int) -> None:
    """Join by another version of the link."""
    link = msgspec.json.decode(os.environ[LINK_GIVEN], type=GivenLink)
    with ZenohBus(link.bus) as bus:
        who = PlannerJoined(name="old", version="1", link=version)
        while True:
            bus.publish("planner_joined", who, run=link.run_id, process=link.process_id)
            time.sleep(0.2)


def spec_of(command: str, table: str = "", planners: str = "") -> str:
    """Return a small sweep's file with a stack; see tests.orchestrator.sweeps."""
    return f"""
worlds = "{{worlds}}"
scenarios = ["scp", "cpta"]
cases = 2
planners = ["mine"{planners}]
horizon_s = 4.0
metrics = ["ttc", "driving_score"]

[remote.mine]
command = {msgspec.json.encode(command).decode()}
{table}
"""


def main(how: str, mark: str = "") -> int:
    """Serve; see the module."""
    if how == "silent":
        time.sleep(HANGS_FOR_S)
    if how == "old":
        join_as(1)
    if how == "remembers":
        mine = Remembers()
        return serve_planner(mine.plan, name="remembers", version="1", reset=mine.reset)
    odd = Odd(how, Path(mark) if mark else None)
    version = os.environ.get("A_STACK_VERSION", "1")
    return serve_planner(odd.plan, name=how, version=version)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
