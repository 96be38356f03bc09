"""Virtual traffic on the bus: the car's states and its course in, road users out."""

from __future__ import annotations

import logging
from pathlib import Path

from foretwin.contracts.bus import Bus, Mailbox, Received, Request
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.lights import ShownLights
from foretwin.contracts.process import ProcessLife
from foretwin.contracts.refusals import Refusals
from foretwin.contracts.setup import TrafficSetup
from foretwin.contracts.virtual_traffic import TrafficCourse
from foretwin.sim_worker.message_loop import passed_over_where_unfit, take_messages
from foretwin.sim_worker.scenarios.reading import find_scenario
from foretwin.sim_worker.virtual_traffic.going import GoingTraffic
from foretwin.sim_worker.virtual_traffic.model import ModelTraffic
from foretwin.sim_worker.virtual_traffic.source import TrafficSource
from foretwin.sim_worker.virtual_traffic.staged import ScenarioTraffic
from foretwin.sim_worker.virtual_traffic.sumo import SumoTraffic, net_of
from foretwin.sim_worker.virtual_traffic.sumo_lights import groups_of_signals
from foretwin.sim_worker.world_file import load_world

_DEPTH = 4096

log = logging.getLogger("traffic")


class TrafficWorker:
    """Feeds a GoingTraffic from messages; one that cannot be used is logged and passed over.

    In lock step lights are those of the course alone: what comes from another process beside the
    states must not decide by which of the two is faster.
    """

    def __init__(self, setup: TrafficSetup, bus: Bus, *, refusals: Refusals | None = None) -> None:
        self._setup, self._bus = setup, bus
        self._refusals = Refusals() if refusals is None else refusals
        self._world_id: str | None = None
        self.going = GoingTraffic(_source(setup), setup.vehicle)

    def handle(self, item: Received | Request) -> None:
        """Take one message or question; never raises."""
        with passed_over_where_unfit(item, refusals=self._refusals, log=log):
            message = item.message()
            match message:
                case VehicleState():
                    for users in self.going.take_state(message):
                        self._bus.publish("virtual_traffic", users, run=self._setup.run_id)
                case ShownLights():
                    self.going.take_lights(message)
                case TrafficCourse():
                    self._take_course(message)
            if isinstance(item, Request):
                item.reply(message)

    def _take_course(self, told: TrafficCourse) -> None:
        world = None
        if told.world_id is not None and told.world_id != self._world_id:
            world = load_world(Path(self._setup.worlds_dir), told.world_id)
            self._world_id = told.world_id
        self.going.take_course(told, world)


def _source(setup: TrafficSetup) -> TrafficSource:
    chosen, vehicle, seed = setup.traffic, setup.vehicle, setup.seed
    match chosen.source:
        case "scenario":
            return ScenarioTraffic(vehicle, find_scenario(chosen.scenario), seed=seed)
        case "sumo":
            assert chosen.network is not None
            folder = Path(setup.worlds_dir).parent / "processes"
            network = Path(chosen.network)
            net = net_of(network, folder)
            group_of = {} if net == network else groups_of_signals(network)
            return SumoTraffic(vehicle, net, count=chosen.count, seed=seed, group_of=group_of)
        case _:
            return ModelTraffic(vehicle, count=chosen.count, seed=seed)


def serve_traffic(setup: TrafficSetup, bus: Bus, life: ProcessLife) -> None:
    """Let virtual road users go on beside the car until the run is over."""
    mailbox = Mailbox(_DEPTH, when_full="block" if setup.bus.lossless else "drop_oldest")
    worker = TrafficWorker(setup, bus, refusals=life.refusals)
    bus.serve("use_course", mailbox, run=setup.run_id, process=setup.process_id)
    if not setup.bus.lossless:
        bus.subscribe("lights", mailbox, run=setup.run_id)
    bus.subscribe("state", mailbox, vehicle=setup.vehicle_id)
    life.ready()
    take_messages(mailbox, worker.handle, life, lossless=setup.bus.lossless)
    if mailbox.dropped or worker.going.missed:
        log.warning(
            "virtual traffic passed over %d messages and left out %d steps",
            mailbox.dropped,
            worker.going.missed,
        )
