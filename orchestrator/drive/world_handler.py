"""The handler where Worlds are asked for, built by the builder, and loaded by every worker."""

from __future__ import annotations

import logging
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field

from foretwin.contracts.bus import Reply, Request
from foretwin.contracts.codec import SchemaMismatch, read_message
from foretwin.contracts.errors import one_line
from foretwin.contracts.fleet import WorldBytes
from foretwin.contracts.guard import Refused
from foretwin.contracts.simulation import BuildRequest, PrepareRequest, WorldNotice
from foretwin.contracts.world import World
from foretwin.orchestrator.context import DriveContext
from foretwin.orchestrator.drive.processes import BUILDER
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.runner.bus_dispatcher import NO_ANSWER

log = logging.getLogger("orchestrator")

BUILD_TIMEOUT_S = 60.0
KEPT_WORLDS = 16
ASKS_AGAIN_AFTER_S = 0.5
MOST_UNANSWERED = 5
"""So often a question for a World may find nobody; one that goes out without a link does too."""


@dataclass(slots=True)
class _Order:
    """One junction's World: whether workers load it, and those that have not done so yet."""

    load: bool
    world_id: str | None = None
    pending: set[str] | None = None
    """None until loading begins."""
    ready: bool = False
    unanswered: int = 0
    ask_at_s: float | None = None
    """When to ask again, on the monotonic clock, if the builder is there."""


@dataclass(slots=True)
class WorldHandler:
    """Asks builder and workers; a World is ready once every worker that is up has loaded it.

    A builder that dies is asked again when it is back; a worker that dies is waited for no more.
    """

    context: DriveContext
    on_ready: Callable[[str, World], None]
    on_failed: Callable[[str, str], None]
    on_load: Callable[[World], None] = lambda _: None
    """Called with each World that the workers load."""
    _orders: dict[str, _Order] = field(default_factory=dict)
    _junction_of: dict[str, str] = field(default_factory=dict)
    _worlds: OrderedDict[str, World] = field(default_factory=OrderedDict)
    """Those used last; the others are read again."""

    @property
    def building(self) -> list[str]:
        """Junctions whose World is not ready yet."""
        return [junction_id for junction_id, order in self._orders.items() if not order.ready]

    def world(self, world_id: str) -> World:
        """Return a World that has been built in this run; OSError where its file is gone."""
        world = self._worlds.get(world_id)
        if world is None:
            file = self.context.plan.worlds_dir / f"{world_id}.world"
            world = self._worlds[world_id] = read_message(file, World)
        self._worlds.move_to_end(world_id)
        while len(self._worlds) > KEPT_WORLDS:
            self._worlds.popitem(last=False)
        return world

    def give(self, request: Request) -> None:
        """Give a World's file to who asks for it by its id.

        Raises Refused, once answered, for what is no such question.
        """
        try:
            world_id = request.message().world_id
            data = (self.context.plan.worlds_dir / f"{world_id}.world").read_bytes()
        except Refused as refused:
            request.refuse(one_line(refused))
            raise
        except OSError as error:
            request.refuse(f"World {world_id}: {error.strerror}")
        else:
            request.reply(WorldBytes(data=data))

    def want(self, junction_id: str, *, load: bool, workers: tuple[str, ...]) -> None:
        """Have a World built, and loaded by `workers` where `load` says so."""
        order = self._orders.get(junction_id)
        if order is None:
            self._orders[junction_id] = _Order(load)
            self._ask_build(junction_id)
            return
        order.load = order.load or load
        if order.world_id is None:
            return
        try:
            world = self.world(order.world_id)
        except (OSError, SchemaMismatch) as error:
            self._build_failed(junction_id, order, str(error))
            return
        if load:
            self._load(order, world, workers)
        if order.ready:  # whoever asks may have forgotten that it is
            self.on_ready(junction_id, world)

    def _ask_build(self, junction_id: str) -> None:
        radius_m = self.context.plan.config.radius_m
        question = BuildRequest(intersection_id=junction_id, radius_m=radius_m)
        self.context.request(BUILDER, "build", question, timeout_s=BUILD_TIMEOUT_S, tag=junction_id)

    def builder_up(self) -> None:
        """The builder is back: ask again for what it owes."""
        for junction_id, order in self._orders.items():
            if order.world_id is None and not order.ready:
                order.ask_at_s = None
                self._ask_build(junction_id)

    def ask_again(self, now_s: float) -> None:
        """Ask the builder, which is up, for what it was asked for in vain; call it often."""
        for junction_id, order in self._orders.items():
            if order.ask_at_s is not None and now_s >= order.ask_at_s:
                order.ask_at_s = None
                self._ask_build(junction_id)

    def build_reply(self, reply: Reply, *, workers: tuple[str, ...], builder_up: bool) -> None:
        """Take the builder's answer and let the workers load the World."""
        junction_id = reply.tag
        order = self._orders[junction_id]
        if reply.message is None:
            order.unanswered += reply.error == NO_ANSWER
            if reply.error == NO_ANSWER and order.unanswered <= MOST_UNANSWERED:
                order.ask_at_s = time.monotonic() + ASKS_AGAIN_AFTER_S
            elif builder_up:
                self._build_failed(junction_id, order, reply.error or "no reason given")
            return
        if order.world_id is not None:
            return
        answer = reply.message
        try:
            world = self.world(answer.world_id)
        except (OSError, SchemaMismatch) as error:
            self._build_failed(junction_id, order, str(error))
            return
        order.world_id = world.id
        self._junction_of[world.id] = junction_id
        how = "from the cache" if answer.cached else "built"
        log.info("world %s of %s %s in %.2f s", world.id, junction_id, how, answer.seconds)
        if order.load:
            self._load(order, world, workers)
        else:
            self._settle(junction_id, order)

    def _build_failed(self, junction_id: str, order: _Order, reason: str) -> None:
        order.ready = True  # nothing more will come of it
        self.on_failed(junction_id, reason)

    def _load(self, order: _Order, world: World, workers: tuple[str, ...]) -> None:
        self.on_load(world)
        if order.pending is None:
            junction_id, file = self._junction_of[world.id], f"{world.id}.world"
            notice = WorldNotice(world_id=world.id, intersection_id=junction_id, file=file)
            self.context.publish("world", notice)
        order.pending = set(workers)
        for worker_id in sorted(order.pending):
            self.prepare(worker_id, world.id)
        self._settle(self._junction_of[world.id], order)

    def prepare(self, worker_id: str, world_id: str) -> None:
        """Let one worker load a World."""
        tag, question = (
            (worker_id, world_id, time.perf_counter()),
            PrepareRequest(world_id=world_id),
        )
        self.context.request(worker_id, "prepare", question, timeout_s=BUILD_TIMEOUT_S, tag=tag)

    def prepare_reply(self, reply: Reply) -> None:
        """Take a worker's answer."""
        worker_id, world_id, asked_s = reply.tag
        if reply.error == NO_ANSWER:
            # Just started or just gone; a job loads the World too.
            log.info("world %s not loaded by %s beforehand", world_id, worker_id)
        elif reply.message is None:
            text = f"{worker_id} could not load world {world_id}: {reply.error}"
            self.context.tell(Notice("warning", text))
        else:
            taken_s = time.perf_counter() - asked_s
            log.info("world %s loaded by %s in %.2f s", world_id, worker_id, taken_s)
        self._loaded(self._junction_of[world_id], worker_id)

    def worker_down(self, worker_id: str) -> None:
        """A worker is gone: nothing waits for it."""
        for junction_id in list(self._orders):
            self._loaded(junction_id, worker_id)

    def _loaded(self, junction_id: str, worker_id: str) -> None:
        order = self._orders[junction_id]
        if order.pending is not None and worker_id in order.pending:
            order.pending.discard(worker_id)
            self._settle(junction_id, order)

    def _settle(self, junction_id: str, order: _Order) -> None:
        if order.world_id is not None and not order.pending and not order.ready:
            order.ready = True
            self.on_ready(junction_id, self.world(order.world_id))
