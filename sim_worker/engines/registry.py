"""Engines by the names that jobs have for them; each is loaded when a job first asks for it."""

from __future__ import annotations

from foretwin.contracts.futures import EngineName
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.engines.engine import PhysicsEngine


def trouble_with_engine(name: EngineName) -> str | None:
    """Return why this machine cannot play on an engine, in one line; None where it can."""
    if name == "gazebo":
        from foretwin.sim_worker.engines.gazebo import trouble_with_gazebo

        return trouble_with_gazebo()
    if name == "carla":
        from foretwin.sim_worker.engines.carla import trouble_with_carla

        return trouble_with_carla()
    return None


def begin_engine(name: EngineName, vehicle: VehicleParameters, *, count: int) -> PhysicsEngine:
    """Return an engine with room for `count` cars; raises ValueError, in one line, where this
    machine has it not, or where it is MuJoCo, whose stage is none of these."""
    if name == "multibody":
        from foretwin.sim_worker.engines.multibody import MultiBody

        return MultiBody(vehicle, count=count)
    if name == "gazebo":
        from foretwin.sim_worker.engines.gazebo import Gazebo

        return Gazebo(vehicle)
    if name == "carla":
        from foretwin.sim_worker.engines.carla import Carla

        return Carla(vehicle)
    raise ValueError(f"engine {name!r} has a stage of its own")
