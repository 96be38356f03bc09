"""A driving stack's side of the planner link: it joins whoever asks, and answers scene by scene."""

from __future__ import annotations

import math
import os
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np

from foretwin.contracts.bus import Bus, BusUnreachable, Mailbox, Received, ZenohBus
from foretwin.contracts.errors import UserError, one_line
from foretwin.contracts.guard import Refused
from foretwin.contracts.joining import newest_running
from foretwin.contracts.planner_link import (
    LINK_VERSION,
    PlannedMotions,
    PlannerJoined,
    PlannerScene,
    other_link,
)
from foretwin.contracts.process_setup import BusSetup
from foretwin.contracts.terminal import say

LINK_GIVEN = "FORETWIN_PLANNER_LINK"
"""The variable of the environment in which a sweep tells the stack that it starts, as the JSON of
`GivenLink`, where it is asked."""
JOIN_S = 30.0
"""So long a stack that nobody started waits for a drive to begin."""
_LOOK_S = 0.5
_JOIN_AGAIN_S = 0.2
_DEPTH = 8

Plan = Callable[[PlannerScene], PlannedMotions]
Reset = Callable[[PlannerScene], object]


class GivenLink(msgspec.Struct, frozen=True, kw_only=True):
    """Where a stack that a sweep has started is asked."""

    bus: BusSetup
    run_id: str
    process_id: str
    """Whose scenes it answers."""


def serve_planner(
    plan: Plan,
    *,
    name: str,
    version: str,
    reset: Reset | None = None,
    out: Path | str = "runs",
    endpoint: str | None = None,
) -> int:
    """Let `plan` answer every scene: of the sweep that has started this process, or else of the
    drives below the folder `out`, one after the other, or at an `endpoint` that asks nobody who
    it is.

    `name` and `version` stand in the sweep's record; rows of another version are never mixed with
    those of this one. `reset` is called with the first scene of futures, before `plan`. What either
    raises fails the futures of the scene, with its words. Returns what the process should exit
    with: 0 once the sweep is over or at Ctrl-C, 2 where nobody is there to join or another version
    is spoken, which it says in one line.
    """
    try:
        given = os.environ.get(LINK_GIVEN)
        if given is not None:
            link = msgspec.json.decode(given, type=GivenLink)
            with ZenohBus(link.bus) as bus:
                who = PlannerJoined(name=name, version=version, link=LINK_VERSION)
                answering = Answering(bus, plan, reset, run=link.run_id, process=link.process_id)
                answering.serve_sweep(who)
            return 0
        _serve_drives(plan, reset, Path(out), endpoint)
    except KeyboardInterrupt:
        return 0
    except (BusUnreachable, UserError, Refused, msgspec.DecodeError) as error:
        say(f"{name}: {' '.join(str(error).split())}", error=True)
    return 2


def _serve_drives(plan: Plan, reset: Reset | None, out: Path, endpoint: str | None) -> None:
    """Answer one drive after the other; UserError or BusUnreachable where none begins in time."""
    end_s = time.monotonic() + JOIN_S
    while True:
        with _joined(out, endpoint, end_s=end_s) as bus:
            Answering(bus, plan, reset, run="*", process="*").serve_drive()
        say("the drive is over; ready for the next one")
        end_s = math.inf


def _joined(out: Path, endpoint: str | None, *, end_s: float) -> ZenohBus:
    """Return the bus of a drive; UserError or BusUnreachable where there is none until then."""
    while True:
        try:
            return ZenohBus(BusSetup(endpoint=endpoint) if endpoint else _bus_of(out))
        except (BusUnreachable, UserError):
            if time.monotonic() > end_s:
                raise
            time.sleep(_JOIN_AGAIN_S)


def _bus_of(out: Path) -> BusSetup:
    try:
        return newest_running(out).bus("planner")
    except UserError:
        where = f"{out}: no drive is running there"
        raise UserError(f"{where}; start one, or name the folder of its runs as `out`") from None


class Answering:
    """Answers the scenes of some workers on a bus, each once, however often it is asked."""

    def __init__(
        self, bus: Bus, plan: Plan, reset: Reset | None, *, run: str, process: str
    ) -> None:
        self._bus, self._plan, self._reset = bus, plan, reset
        self._ids = {"run": run, "process": process}
        self._scenes = Mailbox(_DEPTH)
        self._last: dict[str, PlannedMotions] = {}
        """By who asks."""
        bus.subscribe("planner_scene", self._scenes, run=run, process=process)

    def serve_sweep(self, who: PlannerJoined) -> None:
        """Say who this is until it is asked, and answer until the sweep's worker is gone."""
        asked = False
        while self._bus.connected:
            if not asked:
                self._bus.publish("planner_joined", who, **self._ids)
            asked = self.take(_LOOK_S) or asked

    def serve_drive(self) -> None:
        """Answer whoever asks until the drive's bus is gone."""
        say("ready")
        sys.stdout.flush()
        while self._bus.connected:
            self.take(_LOOK_S)

    def take(self, timeout_s: float) -> bool:
        """Answer one scene; returns whether one came in time.

        Raises UserError where another version of the link is spoken, Refused for what is no scene.
        """
        item = self._scenes.take(timeout_s)
        if not isinstance(item, Received):
            return False
        scene: PlannerScene = item.message()
        if wrong := other_link(scene.link):
            raise UserError(f"worker {scene.worker_id}: {wrong}")
        known = self._last.get(scene.worker_id)
        if known is None or (known.job, known.question) != (scene.job, scene.question):
            known = self._last[scene.worker_id] = self._answer(scene)
        ids = {"run": scene.run_id, "process": scene.worker_id}
        self._bus.publish("planned_motions", known, **ids)
        return True

    def _answer(self, scene: PlannerScene) -> PlannedMotions:
        try:
            if scene.reset and self._reset is not None:
                self._reset(scene)
            answer = self._plan(scene)
            if not isinstance(answer, PlannedMotions):
                raise TypeError(f"plan returned {type(answer).__name__}, not PlannedMotions")
            return msgspec.structs.replace(answer, link=LINK_VERSION)
        except Exception as error:
            traceback.print_exc()
            nothing = np.zeros(0)
            return PlannedMotions(
                job=scene.job,
                question=scene.question,
                futures=(),
                time_s=nothing,
                xy_m=nothing,
                yaw_rad=nothing,
                speed_mps=nothing,
                link=LINK_VERSION,
                failure=one_line(error),
            )
