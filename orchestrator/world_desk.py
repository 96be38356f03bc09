"""The desk where Worlds are asked for, built by the builder, and loaded by every worker."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass

from contracts.bus import Bus, Mailbox, Reply
from contracts.codec import read_message
from contracts.simulation import BuildRequest, PrepareRequest, WorldNotice
from contracts.world import World
from orchestrator.plan import DrivePlan
from orchestrator.processes import BUILDER

log = logging.getLogger("orchestrator")

BUILD_TIMEOUT_S = 60.0


@dataclass(frozen=True, slots=True)
class _Loading:
    """A built World and the workers that have not loaded it yet."""

    junction_id: str
    world: World
    pending: set[str]


class WorldDesk:
    """Asks builder and workers; a World is ready once every worker that is up has loaded it.

    A builder that dies is asked again when it is back; a worker that dies is waited for no more.
    """

    def __init__(
        self,
        plan: DrivePlan,
        bus: Bus,
        mailbox: Mailbox,
        *,
        on_ready: Callable[[str, World], None],
        on_failed: Callable[[str, str], None],
        on_warning: Callable[[str], None],
    ) -> None:
        self._plan = plan
        self._bus = bus
        self._mailbox = mailbox
        self._on_ready = on_ready
        self._on_failed = on_failed
        self._on_warning = on_warning
        self._loading: dict[str, _Loading] = {}
        self.building: set[str] = set()
        """Junctions whose World is not ready yet."""

    def world(self, world_id: str) -> World:
        """Return a World that has been built in this run."""
        return self._loading[world_id].world

    def build(self, junction_id: str) -> None:
        """Ask the builder for the World of a junction."""
        self.building.add(junction_id)
        self._bus.request(
            "build",
            BuildRequest(intersection_id=junction_id, radius_m=self._plan.config.radius_m),
            self._mailbox,
            tag=junction_id,
            timeout_s=BUILD_TIMEOUT_S,
            run=self._plan.run_id,
            process=BUILDER,
        )

    def builder_up(self) -> None:
        """The builder is back: ask again for what it owes."""
        loading = {entry.junction_id for entry in self._loading.values()}
        for junction_id in sorted(self.building - loading):
            self.build(junction_id)

    def build_reply(self, reply: Reply, *, workers: tuple[str, ...], builder_up: bool) -> None:
        """Take the builder's answer and let the workers load the World."""
        junction_id = reply.tag
        if reply.message is None:
            if builder_up and reply.error != "no answer":
                self.building.discard(junction_id)
                self._on_failed(junction_id, reply.error or "no reason given")
            return
        answer = reply.message
        if answer.world_id in self._loading:
            return
        file = self._plan.worlds_dir / f"{answer.world_id}.world"
        world = read_message(file, World)
        loading = _Loading(junction_id, world, set(workers))
        self._loading[answer.world_id] = loading
        how = "from the cache" if answer.cached else "built"
        log.info("world %s of %s %s in %.2f s", world.id, junction_id, how, answer.seconds)
        notice = WorldNotice(world_id=world.id, intersection_id=junction_id, file=file.name)
        self._bus.publish("world", notice, run=self._plan.run_id)
        for worker_id in sorted(loading.pending):
            self.prepare(worker_id, world.id)
        self._settle(loading)

    def prepare(self, worker_id: str, world_id: str) -> None:
        """Let one worker load a World."""
        self._bus.request(
            "prepare",
            PrepareRequest(world_id=world_id),
            self._mailbox,
            tag=(worker_id, world_id, time.perf_counter()),
            timeout_s=BUILD_TIMEOUT_S,
            run=self._plan.run_id,
            process=worker_id,
        )

    def prepare_reply(self, reply: Reply) -> None:
        """Take a worker's answer."""
        worker_id, world_id, asked_s = reply.tag
        loading = self._loading[world_id]
        if reply.message is None:
            self._on_warning(f"{worker_id} could not load world {world_id}: {reply.error}")
        else:
            log.info(
                "world %s loaded by %s in %.2f s", world_id, worker_id,
                time.perf_counter() - asked_s,
            )  # fmt: skip
        if worker_id in loading.pending:
            loading.pending.discard(worker_id)
            self._settle(loading)

    def worker_down(self, worker_id: str) -> None:
        """A worker is gone: nothing waits for it."""
        for loading in self._loading.values():
            if worker_id in loading.pending:
                loading.pending.discard(worker_id)
                self._settle(loading)

    def _settle(self, loading: _Loading) -> None:
        if not loading.pending and loading.junction_id in self.building:
            self.building.discard(loading.junction_id)
            self._on_ready(loading.junction_id, loading.world)
