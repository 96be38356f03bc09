"""The engine `gazebo`: Gazebo's own physics, ign-physics with DART, in a process of its own.

The cars are the twins of our SDFormat export: bodies, wheels and hinges on level ground, rigid
tyres under Coulomb's friction. What stands beside the road is not in there: the stage finds
touches.
"""

from __future__ import annotations

import hashlib
import math
import os
import shutil
import subprocess
from pathlib import Path

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array, Indices
from foretwin.contracts.owned_folder import temporary_folder
from foretwin.contracts.vehicle import Parameter, VehicleParameters
from foretwin.sim_worker.engines.engine import Demand, Seeds
from foretwin.sim_worker.vehicle.timestep import TIMESTEP_S
from foretwin.world_gen.export.sdformat_vehicles import (
    WHEEL_RADIUS_M,
    SdfVehicle,
    add_vehicle,
    track_width_m,
)
from foretwin.world_gen.export.xml_tree import child, document, element, leaves

_LIBRARIES = ("ignition-physics5", "ignition-physics5-sdf", "ignition-plugin1-loader", "sdformat12")
_PLUGIN = "libignition-physics5-dartsim-plugin.so"
_SOURCE = Path(__file__).with_name("gazebo_runner.cc")
_BUILD_S, _LAST_S = 300.0, 5.0
DEBIAN = (
    "libignition-physics-dev libignition-plugin-dev libignition-physics5-dartsim-plugin5 g++ "
    "pkg-config"
)


def plugin_path() -> Path | None:
    """Return where DART for ign-physics is, None where it is not."""
    return next(iter(sorted(Path("/usr/lib").glob(f"*/{_PLUGIN}"))), None)


def trouble_with_gazebo() -> str | None:
    """Return why this machine cannot run or build the engine, in one line; None where it can."""
    asked = ["pkg-config", "--exists", *_LIBRARIES]
    tools = [name for name in ("g++", "pkg-config") if shutil.which(name) is None]
    if not tools and plugin_path() and subprocess.run(asked, check=False).returncode == 0:
        return None
    return f"engine 'gazebo' needs ign-physics 5 with DART (Debian: {DEBIAN})"


def built_runner(folder: Path | None = None) -> Path:
    """Return the runner, compiled into `folder` (the user's cache) where it is not there yet.

    Raises ValueError, in one line, where it cannot be built.
    """
    if (trouble := trouble_with_gazebo()) is not None:
        raise ValueError(trouble)
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "foretwin" / "engines"
    digest = hashlib.sha256(_SOURCE.read_bytes()).hexdigest()[:16]
    runner = (folder or home) / f"gazebo-{digest}"
    if runner.exists():
        return runner
    runner.parent.mkdir(parents=True, exist_ok=True)
    flags = subprocess.run(
        ["pkg-config", "--cflags", "--libs", *_LIBRARIES],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    with temporary_folder("compile-", within=runner.parent) as scratch:
        new = scratch / "runner"
        words = ["g++", "-O2", "-std=c++17", str(_SOURCE), "-o", str(new), *flags]
        done = subprocess.run(words, capture_output=True, text=True, timeout=_BUILD_S, check=False)
        if done.returncode != 0:
            last = (done.stderr.strip().splitlines() or ["no word"])[-1]
            raise ValueError(f"engine 'gazebo' cannot be compiled: {last}")
        new.rename(runner)
    return runner


class Gazebo:
    """Cars of `vehicle`, each in a world of its own, in one process that ends with this."""

    def __init__(self, vehicle: VehicleParameters, *, runner: Path | None = None) -> None:
        """Start the process; raises ValueError where it cannot be started."""
        self._vehicle = vehicle
        track = track_width_m(vehicle)
        numbers = (
            WHEEL_RADIUS_M,
            vehicle.wheelbase_m.value,
            track,
            vehicle.mass_kg.value,
            vehicle.drag_npv2.value,
            vehicle.rolling_resistance_n.value,
            TIMESTEP_S,
        )
        path = built_runner() if runner is None else runner
        self._process = subprocess.Popen(
            [str(path), str(plugin_path()), *map(repr, numbers)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )

    @property
    def process_id(self) -> int:
        """Of the process in which the cars move."""
        return self._process.pid

    def reset(self, rows: Indices, seeds: Seeds) -> None:
        """Let cars begin on their wheels, which roll."""
        for row, state, friction in zip(rows, seeds.states, seeds.friction, strict=True):
            sdf = self._sdf(state, float(friction))
            x, y, yaw, vx, vy, rate, steer, _ = state
            self._say([1.0, row, x, y, yaw, vx, vy, rate, steer, len(sdf)], sdf)
            self._hear(1)

    def step(self, demand: Demand) -> Array:
        """Advance by one control tick; return base_link's columns (7, S)."""
        steps, count = demand.tire_angle_rad.shape
        parts = (demand.drive_mps2, demand.brake_mps2, demand.climb_mps2, demand.tire_angle_rad)
        numbers = np.concatenate([np.ravel(part) for part in parts])
        self._say([2.0, count, steps, *numbers.tolist()])
        return self._hear(7 * count).reshape(7, count)

    def close(self) -> None:
        """End the process."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        try:
            self._process.wait(timeout=_LAST_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _say(self, numbers: list[float], words: bytes = b"") -> None:
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(np.array(numbers, dtype=np.float64).tobytes() + words)
            self._process.stdin.flush()
        except OSError as error:
            raise RuntimeError(self._ended()) from error

    def _hear(self, count: int) -> Array:
        assert self._process.stdout is not None
        said = self._process.stdout.read(8 * count)
        if len(said) < 8 * count:
            raise RuntimeError(self._ended())
        return np.frombuffer(said, dtype=np.float64)

    def _ended(self) -> str:
        return f"the process of the engine 'gazebo' has ended with {self._process.wait()}"

    def _sdf(self, state: Array, friction: float) -> bytes:
        """Return level ground and the twin of our export where a car begins."""
        root = element("sdf", version="1.7")
        world = child(root, "world", name="open_ground")
        ground = child(world, "model", name="ground")
        child(ground, "static", "true")
        part = child(child(ground, "link", name="link"), "collision", name="plane")
        plane = child(child(part, "geometry"), "plane")
        leaves(plane, {"normal": "0 0 1", "size": "1 1"})
        surface = child(child(part, "surface"), "friction")
        # The smaller of both counts: the tyres'.
        leaves(child(surface, "ode"), {"mu": "10", "mu2": "10"})
        slippery = Parameter(friction, None, "of this future")
        car = msgspec.structs.replace(self._vehicle, friction=slippery)
        x, y, yaw = (float(value) for value in state[:3])
        if not math.isfinite(x + y + yaw):
            x = y = yaw = 0.0
        twin = SdfVehicle(name="twin", kind="twin", parameters=car, x_m=x, y_m=y, yaw_rad=yaw)
        add_vehicle(world, twin, "gazebo")
        return document(root)
