"""The gateway as a process: which buses it joins, what it is allowed, and when it leaves."""

from __future__ import annotations

from typing import Self

import pytest
from msgspec.structs import replace

from foretwin.contracts.bus import Mailbox
from foretwin.contracts.refusals import Refusals
from foretwin.contracts.setup import BusSetup, Ros2Setup
from foretwin.telemetry.ros2 import __main__ as process
from foretwin.telemetry.ros2.__main__ import serve
from tests.contracts.memory_bus import MemoryBus
from tests.telemetry.ros2.gateway_ground import (
    FIX_KEY,
    FRAME,
    RecordingForeign,
    fix,
    mapping_text,
)
from tests.telemetry.ros2.order_side import OrderSide

RUN = BusSetup(endpoint="unixsock-stream/run")
S = 10**9


class Car(RecordingForeign):
    """The car's ROS 2, which says one fix as soon as somebody listens; who joined it, and how."""

    def __init__(self) -> None:
        super().__init__()
        self.joined: list[BusSetup] = []
        self.left = False

    def join(self, setup: BusSetup) -> Car:
        self.joined.append(setup)
        return self

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.left = True


class Life:
    """Of three steps; the car speaks before the second."""

    def __init__(self, car: Car) -> None:
        self.refusals, self.is_ready, self._car, self._asked = Refusals(), False, car, 0

    def ready(self) -> None:
        self.is_ready = True

    @property
    def over(self) -> bool:
        self._asked += 1
        if self._asked == 2:
            self._car.arrive(FIX_KEY, fix(5 * S, 52.6, 13.5), mono_ns=1)
        return self._asked > 3


def served(monkeypatch: pytest.MonkeyPatch, **changed: object) -> tuple[Car, Life, Mailbox]:
    car, bus, heard = Car(), MemoryBus(), Mailbox(10)
    bus.subscribe("gnss", heard, vehicle="ego")
    monkeypatch.setattr(process, "ZenohForeignBus", car.join)
    setup = Ros2Setup(
        run_id="r", process_id="ros2", vehicle_id="ego", bus=RUN, log_file="",
        mapping=mapping_text(enabled=True), mapping_name="m.toml", drive_frame=FRAME,
        towards_vehicle=True, order_keys=OrderSide("r").keys,
    )  # fmt: skip
    life = Life(car)
    serve(replace(setup, **changed), bus, life)  # type: ignore[arg-type]
    return car, life, heard


def test_it_passes_on_what_the_car_says_until_its_run_is_over(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    car, life, heard = served(monkeypatch)
    assert (life.is_ready, car.left) == (True, True)
    assert [item.message().position.lat_deg for item in heard_all(heard)] == [52.6]
    assert car.joined == [RUN], "where the mapping names no router the run's own is the car's"
    assert any("%control%cmd" in token for token in car.tokens), "it may speak towards the car"


def test_of_a_car_beside_it_listens_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    car, _, heard = served(monkeypatch, listens_only=True)
    assert len(heard_all(heard)) == 1
    assert not any("%control%cmd" in token or "%twin" in token for token in car.tokens)
    assert any("%sensing%gnss" in token for token in car.tokens)


def test_a_router_of_the_cars_own_is_joined_without_what_the_run_knows_it_by(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    text = mapping_text(enabled=True, endpoint="tcp/car:7447")
    car, *_ = served(monkeypatch, mapping=text, bus=replace(RUN, credentials="secret.json"))
    assert car.joined == [BusSetup(endpoint="tcp/car:7447")]


def heard_all(heard: Mailbox) -> list:  # type: ignore[type-arg]
    return [heard.take() for _ in range(len(heard))]
