"""Engines by the names that jobs have for them; each is loaded when a job first asks for it."""

from __future__ import annotations

from foretwin.contracts.futures import EngineName
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.engines.engine import Engine


def begin_engine(name: EngineName, vehicle: VehicleParameters, *, count: int) -> Engine:
    """Return an engine with room for `count` cars; raises ValueError, in one line, where this
    machine has it not, or where it is MuJoCo, whose stage is none of these."""
    if name == "multibody":
        from foretwin.sim_worker.engines.multibody import MultiBody

        return MultiBody(vehicle, count=count)
    raise ValueError(f"engine {name!r} is none that drives on open ground here; known: multibody")
