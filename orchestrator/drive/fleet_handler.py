"""The handler of workers on other machines: they enlist, are measured and tried, and play along.

One is given work once its clock is near ours and its probe futures came to the bits of ours. What
it is asked is never waited for: Worlds, rounds and parameters go on without it.
"""

from __future__ import annotations

import functools
import logging
import time
from collections.abc import Callable
from typing import Any

import msgspec

from foretwin.contracts.bus import Reply
from foretwin.contracts.fleet import (
    Admittance,
    ClockQuestion,
    EnlistRequest,
    MachineInfo,
    is_far,
)
from foretwin.contracts.simulation import PrepareRequest
from foretwin.contracts.world import World
from foretwin.orchestrator.context import DriveContext
from foretwin.orchestrator.drive.far_member import FarMember, FleetTag
from foretwin.orchestrator.drive.reference_probe import ReferenceProbe
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.record.machine import this_machine
from foretwin.orchestrator.rounds.jobs import planners_of
from foretwin.orchestrator.rounds.runner import RoundRunner
from foretwin.orchestrator.tuning.parameter_versions import ParameterVersions
from foretwin.sim_worker.futures.result_digest import result_digest

MOST_MEMBERS = 64
MOST_LOADED = 8
"""Worlds that a member keeps compiled."""
CLOCK_QUESTIONS = 3
"""So many before a clock is judged: the first one finds caches cold."""
PROBES = 2
"""The first warms what the second is timed by."""
ANSWER_S, PROBE_S, CLOCK_S = 5.0, 60.0, 1.0
ASKS_AGAIN_S = 0.5
HEARD_EVERY_S, SILENT_EVERY_S = 1.0, 0.2
"""How often a member is asked for the time, and one that was not heard."""

log = logging.getLogger("orchestrator")


class FleetHandler:
    """All workers of other machines in one drive; in lock step, and on one host, there are none."""

    def __init__(
        self, context: DriveContext, rounds: RoundRunner, parameters: ParameterVersions
    ) -> None:
        config = context.plan.config
        self._context, self._rounds, self._parameters = context, rounds, parameters
        self._far = rounds.dispatcher.dispatch.far
        self.open = config.endpoint is not None and not config.lock_step
        """Whether any may come."""
        self._members: dict[str, FarMember] = {}
        self._proved: set[str] = set()
        """Instances that have come to our bits."""
        self._worlds: dict[str, None] = {}
        """Ids of Worlds that members are to have, in the order in which they came."""
        self._reference = ReferenceProbe(config, rounds)
        rounds.on_other = self._reference.take
        self._told: set[str] = set()
        self._on_reply: dict[str, Callable[[FarMember, Reply], None]] = {
            "enlist": self._enlisted,
            "clock": self._clock,
            "prepare": self._prepared,
            "job": self._probed,
            "admit": lambda member, reply: None,
        }

    @functools.cached_property
    def _ours(self) -> MachineInfo:
        return this_machine()

    def takes(self, process_id: str) -> bool:
        """Whether a process that says it is there is one of these."""
        known = process_id in self._members
        return self.open and is_far(process_id) and (known or len(self._members) < MOST_MEMBERS)

    def alive(self, process_id: str, *, up: bool) -> None:
        """A worker is there, or gone."""
        member = self._members.setdefault(process_id, FarMember(process_id))
        self._leave(member)
        if up:
            self._enlist(member)
        else:
            member.stage = "gone"
            self._tell("info", f"{process_id} is gone")

    def load(self, world: World) -> None:
        """Let members load a World as the drive's own workers do; the first is the probe's."""
        if not self.open:
            return
        self._worlds.pop(world.id, None)
        self._worlds[world.id] = None
        self._reference.use(world)
        for member in self._members.values():
            if member.stage == "playing":
                self._ask(member, "prepare", PrepareRequest(world_id=world.id), PROBE_S, world.id)

    def keep_up(self) -> None:
        """Take members that have other parameters than those in force out until they have them."""
        for member in self._members.values():
            if member.stage == "playing" and member.version != self._parameters.version:
                self._leave(member)
                self._enlist(member)

    def look(self, now_s: float) -> None:
        """Ask for the time, and again for what was left without an answer; call it often."""
        for member in self._members.values():
            if member.again_s is not None and now_s >= member.again_s:
                self._enlist(member)
            if member.stage == "waiting" and self._reference.task(self._parameters) is not None:
                self._probe(member)
            if member.stage == "playing" and now_s >= member.next_clock_s:
                silent = self._far.is_silent(member.worker_id)
                member.next_clock_s = now_s + (SILENT_EVERY_S if silent else HEARD_EVERY_S)
                self._ask_clock(member)

    def reply(self, reply: Reply) -> None:
        """Take an answer to a question of ours."""
        tag: FleetTag = reply.tag
        member = self._members[tag.worker_id]
        if tag.turn == member.turn or tag.channel == "clock":
            self._on_reply[tag.channel](member, reply)

    def record(self) -> list[dict[str, Any]]:
        """Return what run.json says of each."""
        return [one.record(self._ours) for _, one in sorted(self._members.items())]

    @property
    def playing(self) -> tuple[FarMember, ...]:
        """Those that are given work."""
        return tuple(one for one in self._members.values() if one.stage == "playing")

    def _ask(
        self,
        member: FarMember,
        channel: str,
        question: msgspec.Struct,
        timeout_s: float,
        detail: str = "",
    ) -> None:
        tag = FleetTag(member.worker_id, channel, member.turn, time.monotonic(), detail)
        self._context.request(member.worker_id, channel, question, timeout_s=timeout_s, tag=tag)

    def _enlist(self, member: FarMember) -> None:
        config, parameters = self._context.plan.config, self._parameters
        member.begin(parameters.version)
        question = EnlistRequest(
            vehicle=parameters.in_force.vehicle,
            version=parameters.version,
            foretwin=self._ours.versions["foretwin"],
            planners=tuple(dict.fromkeys(planners_of(config.planner))),
            simulations=config.futures_per_job,
            kept_worlds=MOST_LOADED,
        )
        self._ask(member, "enlist", question, ANSWER_S)

    def _ask_clock(self, member: FarMember) -> None:
        if not member.clock_asked:
            member.clock_asked = True
            self._ask(member, "clock", ClockQuestion(), CLOCK_S)

    def _enlisted(self, member: FarMember, reply: Reply) -> None:
        if reply.message is None:
            if reply.refused is not None or not self._again(member, reply):
                self._refuse(member, f"{member.machine} does not join: {reply.error}")
            return
        member.said = reply.message
        ours = self._ours
        if trouble := member.version_trouble(ours) or member.arithmetic_trouble(ours):
            self._refuse(member, trouble)
        elif member.instance in self._proved:
            self._play(member)
        else:
            member.stage = "clock"
            self._ask_clock(member)

    def _clock(self, member: FarMember, reply: Reply) -> None:
        member.clock_asked = False
        asked_s, answered_s = reply.tag.asked_s, reply.received_mono_ns * 1e-9
        if reply.message is None:
            self._far.silent(member.worker_id)
            if member.stage == "clock":
                self._again(member, reply)
            return
        ours_ns = time.time_ns() - (time.monotonic_ns() - reply.received_mono_ns)
        member.clock.take(asked_s, answered_s, ours_ns=ours_ns, theirs_ns=reply.message.utc_ns)
        self._far.heard(member.worker_id, answered_s - asked_s)
        if (trouble := member.clock_trouble()) and member.stage != "refused":
            self._refuse(member, trouble)
        elif member.stage == "clock":
            if len(member.clock) < CLOCK_QUESTIONS:
                self._ask_clock(member)
            else:
                member.stage = "waiting"

    def _probe(self, member: FarMember) -> None:
        member.stage = "probing"
        world_id = self._reference.world_id
        self._ask(member, "prepare", PrepareRequest(world_id=world_id), PROBE_S, world_id)

    def _prepared(self, member: FarMember, reply: Reply) -> None:
        world_id = reply.tag.detail
        if reply.message is None:
            if member.stage == "probing" and not self._again(member, reply):
                self._refuse(member, f"{member.machine} has no World to play in: {reply.error}")
            elif member.stage == "playing":
                self._tell("warning", f"{member.machine} plays not in {world_id}: {reply.error}")
        elif member.stage == "playing":
            self._far.has_world(member.worker_id, world_id)
        elif member.stage == "probing":
            self._ask_probe(member)

    def _ask_probe(self, member: FarMember) -> None:
        task = self._reference.task(self._parameters)
        if task is None:  # other parameters since
            self._enlist(member)
        else:
            self._ask(member, "job", task.question, PROBE_S, task.key)

    def _probed(self, member: FarMember, reply: Reply) -> None:
        if reply.message is None or reply.message.result is None:
            if not self._again(member, reply):
                self._refuse(member, f"{member.machine} cannot play: {reply.error}")
            return
        member.probes += 1
        expected = self._reference.digest(reply.tag.detail)
        if result_digest(reply.message.result) != expected:
            self._refuse(member, member.bits_trouble(self._ours))
        elif member.probes < PROBES:
            self._ask_probe(member)
        else:
            took_s = reply.received_mono_ns * 1e-9 - reply.tag.asked_s
            member.measured(took_s, futures=len(reply.message.result.future_indices))
            self._proved.add(member.instance)
            self._play(member)

    def _play(self, member: FarMember) -> None:
        member.stage = "playing"
        self._far.join(member.worker_id, work_s=member.work_s, link_s=member.clock.last.link_s)
        self._ask(member, "admit", Admittance(), ANSWER_S)
        self._rounds.enroll(member.worker_id)
        self._rounds.worker_up(member.worker_id)
        for world_id in list(self._worlds)[-MOST_LOADED:]:
            self._ask(member, "prepare", PrepareRequest(world_id=world_id), PROBE_S, world_id)
        self._rounds.dispatcher.give_out()
        self._tell("info", f"{member.worker_id} plays along: {member.text}")

    def _leave(self, member: FarMember) -> None:
        """Give a member nothing, and what it had to others."""
        if member.stage == "playing":
            self._rounds.worker_down(member.worker_id)
            self._rounds.never_again(member.worker_id)
            self._far.leave(member.worker_id)
            self._rounds.dispatcher.give_out()
        member.stage = "asked"

    def _again(self, member: FarMember, reply: Reply) -> bool:
        """Begin anew soon where nobody answered; False for an answer that says why not."""
        if reply.error is not None and not reply.error.startswith(("no answer", "Timeout")):
            return False
        member.again_s = time.monotonic() + ASKS_AGAIN_S
        member.stage = "asked"
        return True

    def _refuse(self, member: FarMember, reason: str) -> None:
        self._leave(member)
        member.stage, member.refused = "refused", reason
        self._ask(member, "admit", Admittance(refused=reason), ANSWER_S)
        self._tell("warning", f"{reason}; it gets no work")

    def _tell(self, level: Any, text: str) -> None:
        if text not in self._told:
            self._told.add(text)
            self._context.tell(Notice(level, text))
        else:
            log.info("%s", text)
