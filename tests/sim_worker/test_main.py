"""The command of a worker process finds its role."""

from __future__ import annotations

import os
from typing import Any

import msgspec
import pytest

from foretwin.contracts.process import ProcessLife
from foretwin.contracts.setup import BusSetup, WorkerSetup
from foretwin.sim_worker import worker
from foretwin.sim_worker.__main__ import serve
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.contracts.memory_bus import MemoryBus

SETUP = WorkerSetup(
    bus=BusSetup(endpoint="tcp/127.0.0.1:1"),
    run_id="r1",
    vehicle_id="car",
    log_file="",
    process_id="w0",
    role="futures",
    worlds_dir="",
    vehicle=load_vehicle(),
)


def test_the_role_of_the_setup_is_served(monkeypatch: pytest.MonkeyPatch) -> None:
    served: list[tuple[Any, ...]] = []
    monkeypatch.setattr(worker, "serve_futures", lambda *given: served.append(given))
    bus = MemoryBus()
    life = ProcessLife(SETUP, bus)
    serve(SETUP, bus, life)
    assert served == [(SETUP, bus, life)]


def test_who_gives_way_does_so_before_it_loads_anything(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[object] = []
    monkeypatch.setattr(os, "nice", done.append)
    monkeypatch.setattr(worker, "serve_futures", lambda *_: done.append("served"))
    gives_way, bus = msgspec.structs.replace(SETUP, gives_way=True), MemoryBus()
    serve(gives_way, bus, ProcessLife(gives_way, bus))
    assert done == [19, "served"]


def test_an_unknown_role_names_the_known_ones() -> None:
    other, bus = msgspec.structs.replace(SETUP, role="cook"), MemoryBus()
    with pytest.raises(ValueError, match="unknown role 'cook'; known: futures, mirror"):
        serve(other, bus, ProcessLife(other, bus))
