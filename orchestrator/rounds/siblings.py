"""Digital siblings of a drive: after a round, a second engine plays its nominal and worst future.

Nobody waits for it but lock step: where a round is late, where it has not answered, or where it has
had its share of a core, it is not asked.
"""

from __future__ import annotations

import time
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array, Array32
from foretwin.contracts.bus import Reply
from foretwin.contracts.futures import FuturesResult, Job
from foretwin.contracts.job_identity import job_bytes
from foretwin.contracts.runner import Answer, JobAnswer, job_task
from foretwin.contracts.siblings import APART_AFTER_S, SiblingFuture, WhichFuture
from foretwin.contracts.simulation import RED_FROM, Comparison
from foretwin.orchestrator.context import DriveContext
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.record.result_rows import RoundFutures
from foretwin.orchestrator.record.sibling_count import SiblingCount
from foretwin.orchestrator.runner.bus_dispatcher import BusDispatcher
from foretwin.orchestrator.runner.open_rounds import RoundDone, misfit_of
from foretwin.sim_worker.futures.columns import row_of
from foretwin.sim_worker.futures.future_rows import Row, motion_sha256

SIBLING = "sibling"
"""The process in which the second engine plays."""
WITHIN_S = 20.0
"""Live, an answer is waited for so long: at its first job in a World the process compiles that."""
MATTERS_FROM_M = 1.0
"""Nominal futures so far apart after 4 s matter: just more than engines were apart at any of the
junctions of `python -m tests.engines`."""
MOST_TOLD = 8
"""Different reasons for no answer of which is told; each once."""
TOLD_EVERY_S = 10.0
"""No more often is told that engines disagree, in drive time: in lock step no clock decides."""


class AskedSiblings(NamedTuple):
    """What the second engine was asked, and what became of it on MuJoCo: states (K, N, 8),
    collisions (K,) and criticality (K,)."""

    job: Job
    future_ids: tuple[str, ...]
    states: Array32
    collided: Array
    criticality: Array
    asked_s: float


class SiblingRounds:
    """Asks the second engine after rounds, and keeps what it says beside what MuJoCo said."""

    def __init__(self, context: DriveContext) -> None:
        config = context.plan.config
        self._context, self._config = context, config.siblings
        self._within_s = None if config.lock_step else WITHIN_S
        self._dispatcher = BusDispatcher(
            context.bus, context.mailbox, run_id=context.plan.run_id, expected=(SIBLING,)
        )
        self._asked: dict[str, AskedSiblings] = {}
        self._up = False
        self._next_s = 0.0
        self._told_ns: int | None = None
        self._life_cpu_s = 0.0
        self._failures: set[str] = set()
        self.count = SiblingCount()

    @property
    def waits(self) -> bool:
        """Whether an answer is still to come."""
        return bool(self._asked)

    def process_up(self, process_id: str) -> None:
        """Ask from now on, where it is the second engine's process that can play."""
        if process_id == SIBLING and not self._up:
            self._up, self._life_cpu_s = True, 0.0
            self._take(self._dispatcher.worker_up(SIBLING))

    def process_down(self, process_id: str) -> None:
        """Ask no more, where it is the second engine's process that is gone."""
        if process_id == SIBLING:
            self._up = False
            for key in list(self._asked):
                self._dispatcher.cancel(key)
                self._drop(key)  # its supervisor tells of its end
            self._take(self._dispatcher.worker_down(SIBLING))

    def take_round(self, done: RoundDone, futures: RoundFutures, rows: list[Row]) -> None:
        """Ask for the siblings of a complete round, unless something is against it."""
        if not self._config.on:
            return
        now_s = time.monotonic()
        if why := self._against(done, now_s):
            self.count.dropped[why] += 1
            return
        known = futures.valid & ~np.isnan(futures.criticality)
        worst = int(np.argmax(np.where(known, futures.criticality, -1.0)))
        places = [0] if worst == 0 else [0, worst]
        job = sibling_job(done, places, self._config.engine)
        named = job_bytes(job)
        self._asked[named.sha256] = AskedSiblings(
            job,
            tuple(rows[place]["future_id"] for place in places),
            futures.states[places].astype(np.float32),
            futures.collided[places],
            futures.criticality[places],
            now_s,
        )
        self._dispatcher.submit(job_task(job, named), within_s=self._within_s)
        self._dispatcher.give_out()

    def _against(self, done: RoundDone, now_s: float) -> str:
        """Return why a round has no siblings, in a word; empty where nothing is against them."""
        if not self._up:
            return "gone"
        if self._within_s is None:
            return ""
        if done.late or self._slowed(done):
            return "late"
        if self._asked:
            return "busy"
        return "share" if now_s < self._next_s else ""

    def _slowed(self, done: RoundDone) -> bool:
        """Whether rounds are smaller than was asked for, since the machine is too slow."""
        return len(done.order.futures) < self._context.plan.config.futures

    def reply(self, reply: Reply) -> None:
        """Take what the second engine says, or that it says nothing."""
        _, task = reply.tag
        asked = self._asked.get(task.key)
        if asked is not None and reply.message is not None:
            misfit = misfit_of(asked.job, reply.message.result)
            if misfit or reply.message.result.unplaced:
                reply = reply._replace(message=None, error=f"of no use: {misfit or 'unplaced'}")
        self._take(self._dispatcher.reply(reply))
        self._dispatcher.give_out()

    def take_comparison(self, comparison: Comparison) -> None:
        """Count how wrong MuJoCo's nominal future was."""
        self.count.take_error(comparison.round_id, comparison.horizon_s, comparison.nominal.fde_m)

    def _take(self, answers: list[Answer]) -> None:
        for answer in answers:
            if answer.message is None:
                self._drop(answer.task.key, answer.failure)
            elif (asked := self._asked.pop(answer.task.key, None)) is not None:
                self._keep(asked, answer.message)

    def _keep(self, asked: AskedSiblings, answer: JobAnswer) -> None:
        assert answer.result is not None
        now_s = time.monotonic()
        cpu_s, self._life_cpu_s = answer.cpu_s - self._life_cpu_s, answer.cpu_s
        # Nothing is saved up: it never has more than its share, over whatever time.
        self._next_s = asked.asked_s + cpu_s / self._config.share
        found = sibling_futures(asked, answer.result, cpu_s=cpu_s, took_s=now_s - asked.asked_s)
        rows = [row_of(one) for one in found]
        self._context.tables.add("siblings", rows)
        for one, row in zip(found, rows, strict=True):
            self.count.take(row)
            self._context.publish("sibling", one)
            self._tell(one)

    def _drop(self, key: str, reason: str = "") -> None:
        if self._asked.pop(key, None) is None:
            return
        self.count.dropped["failed"] += 1
        if reason and reason not in self._failures and len(self._failures) < MOST_TOLD:
            self._failures.add(reason)
            self._context.tell(Notice("warning", f"{self._config.engine} beside MuJoCo: {reason}"))

    def _tell(self, one: SiblingFuture) -> None:
        told_ns = self._told_ns
        lately = told_ns is not None and abs(one.stamp_ns - told_ns) < TOLD_EVERY_S * 1e9
        if one.matters and not lately:
            self._told_ns = one.stamp_ns
            self._context.tell(Notice("warning", disagreement_text(one)))


def sibling_job(done: RoundDone, places: list[int], engine: str) -> Job:
    """Return the job of some futures of a round, by their places in it, on another engine."""
    jobs = done.order.jobs
    futures = tuple(done.order.futures[place] for place in places)
    scenarios = {one.id: one for job in jobs for one in job.scenarios}
    named = sorted({future.scenario_id for future in futures} & scenarios.keys())
    return msgspec.structs.replace(
        jobs[0],
        futures=futures,
        scenarios=tuple(scenarios[name] for name in named),
        engine=engine,
        metrics=(),
        accidents=False,
    )


def sibling_futures(
    asked: AskedSiblings, result: FuturesResult, *, cpu_s: float, took_s: float
) -> list[SiblingFuture]:
    """Return how far two engines are apart in the futures that both have played."""
    job, found = asked.job, []
    instants = [round(after_s / job.step_s) for after_s in APART_AFTER_S]
    for place, future_id in enumerate(asked.future_ids):
        ours = asked.states[place].astype(np.float64)
        theirs = result.trajectory.states[place].astype(np.float64)
        apart_m = np.hypot(*(theirs[:, :2] - ours[:, :2]).T)
        turned = np.angle(np.exp(1j * (theirs[:, 2] - ours[:, 2])))
        told = [_at(apart_m, instant) for instant in instants]
        last = max((instant for instant in instants if instant < len(apart_m)), default=0)
        which: WhichFuture = "nominal" if place == 0 else "worst"
        collided = bool(asked.collided[place]), bool(result.outcome.collided[place])
        counts = which == "nominal" or bool(asked.criticality[place] >= RED_FROM)
        parted = which == "nominal" and (told[-1] or 0.0) >= MATTERS_FROM_M
        found.append(
            SiblingFuture(
                round_id=job.round_id,
                stamp_ns=job.state.stamp_ns,
                engine=job.engine,  # type: ignore[arg-type]
                which=which,
                future_id=future_id,
                apart_1_s_m=told[0],
                apart_2_s_m=told[1],
                apart_4_s_m=told[2],
                heading_rad=_at(turned, last),
                collided=collided[0],
                sibling_collided=collided[1],
                matters=parted or (counts and collided[0] != collided[1]),
                cpu_seconds=cpu_s / len(asked.future_ids),
                took_s=took_s,
                motion_sha256=motion_sha256(result, place),
            )
        )
    return found


def _at(values: Array, instant: int) -> float | None:
    if instant >= len(values) or not np.isfinite(values[instant]):
        return None
    return float(values[instant])


def disagreement_text(one: SiblingFuture) -> str:
    """Say how two engines disagree about a future."""
    if one.collided != one.sibling_collided:
        who = one.engine if one.sibling_collided else "MuJoCo"
        return f"engines disagree: the {one.which} future collides on {who} alone"
    return (
        f"engines disagree: MuJoCo and {one.engine} are {one.apart_4_s_m:.1f} m apart in "
        f"{APART_AFTER_S[-1]:g} s"
    )
