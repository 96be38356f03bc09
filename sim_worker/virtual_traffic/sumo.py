"""SUMO as a going simulation: a district flows, and its vehicles react to the car.

The extra `sumo`; libsumo lives in this process, one simulation at a time. Positions of SUMO are
those of a vehicle's front, angles clockwise from north, in degrees.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoadUserKind, SignalColour
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.polyline import densified
from foretwin.sim_worker.driver_model import EMERGENCY_DECEL_MPS2
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS
from foretwin.sim_worker.virtual_traffic.source import FIRST_M, STEP_S, UNSEEN_M, VirtualUser
from foretwin.sim_worker.virtual_traffic.sumo_lights import SumoLights

NEEDS_SUMO = "virtual_traffic: source sumo needs SUMO: pip install 'foretwin[sumo]'"
_CAR = "car-itself"
_CLASSES: tuple[tuple[RoadUserKind, str, float], ...] = (
    ("car", "passenger", 0.84), ("van", "delivery", 0.1), ("lorry", "truck", 0.03),
    ("motorcycle", "motorcycle", 0.03),
)  # fmt: skip
"""Kinds with SUMO's class, and their shares."""
_DECEL_MPS2 = 4.0
_SPEED, _PLACE, _ANGLE, _INDEX, _TYPE, _ROAD = 0x40, 0x42, 0x43, 0x69, 0x4F, 0x50
"""SUMO's numbers of what is asked of a vehicle."""
_NEXT_M = 10.0
"""Between points of an edge that are held against the car's place."""
_NOWHERE = -1e6
_EVERY = 10
"""Steps between two looks at who is missing, and who nearly is where it was going."""
_NETCONVERT_S = 120.0


def is_there() -> bool:
    """Whether libsumo can be imported; it is not."""
    return find_spec("libsumo") is not None


def check_network(network: Path) -> None:
    """Raise UserError for a network that is not there, or that netconvert would read backwards."""
    if not network.is_file():
        raise UserError(f"virtual_traffic: network {network}: no such file")
    if b'rule="LHT"' in network.read_bytes():
        raise UserError(
            f"virtual_traffic: network {network}: netconvert has left-hand traffic of 1.8 "
            "driven backwards; write it with --opendrive-version 1.4"
        )


def net_of(network: Path, folder: Path) -> Path:
    """Return SUMO's network of an OpenDRIVE file of ours, made in `folder`, or the one given.

    Raises UserError where netconvert is not there or refuses it.
    """
    if network.name.endswith(".net.xml"):
        return network
    found = shutil.which("netconvert")
    if found is None and (package := find_spec("sumo")) and package.origin:
        found = shutil.which("netconvert", path=str(Path(package.origin).parent / "bin"))
    if found is None:
        raise UserError(f"{network}: netconvert is not there; {NEEDS_SUMO}")
    net = folder / f"{network.stem}.net.xml"
    done = subprocess.run(
        [
            found,
            *("--opendrive-files", str(network), "-o", str(net), "--no-warnings"),
            *("--junctions.limit-turn-speed", "2.5"),
        ],
        capture_output=True,
        text=True,
        timeout=_NETCONVERT_S,
        check=False,
    )
    if done.returncode != 0:
        line = " ".join((done.stderr or done.stdout).split())[-300:]
        raise UserError(f"{network}: netconvert makes no network of it: {line}")
    return net


class SumoTraffic:
    """`count` vehicles of SUMO in a district around a car; see TrafficSource."""

    def __init__(
        self,
        vehicle: VehicleParameters,
        net: Path,
        *,
        count: int,
        seed: int,
        group_of: Mapping[str, str] | None = None,
    ) -> None:
        """`group_of` says the World's group of lights of each signal that the network names.

        Raises UserError without SUMO, or for a network without a place on Earth.
        """
        if not is_there():
            raise UserError(NEEDS_SUMO)
        self._sumo: Any = import_module("libsumo")
        self.frame, self._offset_m = _place_of(net)
        self._count, self._rng = count, np.random.default_rng(seed)
        length = vehicle.length_m.value
        self._front_m = box_centre_from_base_m(vehicle) + length / 2.0
        self._named = self._steps = 0
        self._rears: dict[str, Array] = {}
        options = {
            "net-file": net,
            "step-length": STEP_S,
            "seed": seed % 2**31,
            "time-to-teleport": -1,
            "collision.action": "none",
            "lanechange.duration": 3,
            "no-warnings": "true",
            "no-step-log": "true",
        }
        given = [text for name, value in options.items() for text in (f"--{name}", str(value))]
        self._sumo.start(["sumo", *given])
        self._lights = SumoLights(self._sumo, group_of or {})
        self._make_types(length, vehicle.width_m.value)
        edges = [one for one in self._sumo.edge.getIDList() if not one.startswith(":")]
        self._edges = [one for one in sorted(edges) if self._is_for_cars(one)]
        if len(self._edges) < 2:
            raise UserError(f"{net}: holds no two edges for cars")
        shapes = [np.array(self._sumo.lane.getShape(f"{one}_0")) for one in self._edges]
        # Of a vehicle longer than the edge that it begins on SUMO tells an angle turned round.
        longest_m = max(KINDS[kind].length_m for kind, _, _ in _CLASSES)
        self._holds = np.array(
            [self._sumo.lane.getLength(f"{one}_0") >= longest_m for one in self._edges]
        )
        dense = [densified(one, spacing_m=_NEXT_M) for one in shapes]
        self._points_m = np.concatenate(dense)
        self._first_of = np.cumsum([0, *(len(one) for one in dense[:-1])])
        self._sumo.route.add(_CAR, [self._edges[0]])
        self._sumo.vehicle.add(_CAR, _CAR, typeID=_CAR)
        self._sumo.vehicle.setSpeedMode(_CAR, 0)

    def _is_for_cars(self, edge: str) -> bool:
        allowed = self._sumo.lane.getAllowed(f"{edge}_0")
        return not allowed or "passenger" in allowed

    def _make_types(self, length_m: float, width_m: float) -> None:
        types = self._sumo.vehicletype
        for kind, name, _ in _CLASSES:
            traits = KINDS[kind]
            types.copy("DEFAULT_VEHTYPE", kind)
            types.setVehicleClass(kind, name)
            types.setLength(kind, traits.length_m)
            types.setWidth(kind, traits.width_m)
            types.setAccel(kind, min(traits.accel_mps2, 2.0))
            types.setDecel(kind, min(traits.decel_mps2, _DECEL_MPS2))
            types.setEmergencyDecel(kind, min(traits.hard_decel_mps2, EMERGENCY_DECEL_MPS2))
        types.copy("DEFAULT_VEHTYPE", _CAR)
        types.setLength(_CAR, length_m)
        types.setWidth(_CAR, width_m)

    def close(self) -> None:
        """End the simulation: a process holds one at a time."""
        self._sumo.close()

    def use_world(self, world: World) -> None:
        """Nothing changes: the district is there for the whole drive."""

    def use_path(self, xy_m: Array) -> None:
        """Nothing changes: SUMO's vehicles see the car where it is."""

    def step(
        self, car: Array, *, time_s: float, colours: Mapping[str, SignalColour]
    ) -> tuple[VirtualUser, ...]:
        """Move on; lights that no `colours` name are SUMO's own. See TrafficSource."""
        vehicles = self._sumo.vehicle
        x, y, yaw, speed = car[:4].tolist()
        ahead_m = self._front_m * np.array([np.cos(yaw), np.sin(yaw)])
        front = self._offset_m + np.array([x, y]) + ahead_m
        if self._steps % _EVERY == 0:
            self._let_come(front)
            self._lead_on()
        vehicles.moveToXY(_CAR, "", -1, *front.tolist(), 90.0 - np.degrees(yaw), keepRoute=2)
        vehicles.setSpeed(_CAR, max(speed, 0.0))
        self._lights.show(colours)
        self._sumo.simulationStep()
        self._leave_out_who_waits()
        self._steps += 1
        found = vehicles.getAllSubscriptionResults()
        there = {name: told for name, told in sorted(found.items()) if told[_PLACE][0] > _NOWHERE}
        rears = {name: self._rear(name, told) for name, told in there.items()}
        self._rears = rears
        return tuple(self._user(name, told, rears[name]) for name, told in there.items())

    def _rear(self, name: str, told: Mapping[int, Any]) -> Array:
        """Return (2,) where a rear follows its front: SUMO turns both at once at corners."""
        front = np.array(told[_PLACE])
        length_m = KINDS[told[_TYPE]].length_m
        before = self._rears.get(name)
        if before is None:
            angle = np.radians(90.0 - told[_ANGLE])
            return front - length_m * np.array([np.cos(angle), np.sin(angle)])
        towards = before - front
        return np.asarray(front + length_m * towards / max(float(np.hypot(*towards)), 1e-6))

    def _user(self, name: str, told: Mapping[int, Any], rear: Array) -> VirtualUser:
        kind: RoadUserKind = told[_TYPE]
        front = np.array(told[_PLACE])
        x, y = (0.5 * (front + rear) - self._offset_m).tolist()
        yaw, size = float(np.arctan2(*(front - rear)[::-1])), KINDS[kind]
        speed = float(told[_SPEED])
        return VirtualUser(name, kind, x, y, yaw, speed, size.length_m, size.width_m)

    def _let_come(self, car_m: Array) -> None:
        """Let vehicles come who are missing, where the car cannot see it."""
        sumo, rng, begins = self._sumo, self._rng, self._steps == 0
        there = set(sumo.vehicle.getIDList()) | set(sumo.simulation.getPendingVehicles())
        missing = self._count - len(there - {_CAR})
        away_m = np.minimum.reduceat(np.hypot(*(self._points_m - car_m).T), self._first_of)
        fits = np.flatnonzero(self._holds & (away_m > (FIRST_M if begins else UNSEEN_M)))
        kinds, _, shares = zip(*_CLASSES, strict=True)
        for _ in range(3 * missing if begins else min(missing, 3)):
            if missing <= 0 or not len(fits):
                return
            edge, goal = self._edges[int(rng.choice(fits))], str(rng.choice(self._edges))
            kind = str(rng.choice(kinds, p=np.array(shares) / sum(shares)))
            edges = sumo.simulation.findRoute(edge, goal, kind).edges
            if len(edges) < 2:
                continue
            self._named += 1
            name = f"virtual-{self._named}"
            sumo.route.add(name, edges)
            sumo.vehicle.add(
                name, name, typeID=kind, departLane="best", departPos="random_free",
                departSpeed="max",
            )  # fmt: skip
            sumo.vehicle.subscribe(name, [_SPEED, _PLACE, _ANGLE, _INDEX, _TYPE, _ROAD])
            missing -= 1

    def _leave_out_who_waits(self) -> None:
        """Take back for whom there was no room: by the time there is, the car may be near."""
        for name in self._sumo.simulation.getPendingVehicles():
            if name != _CAR:
                self._sumo.vehicle.unsubscribe(name)
                self._sumo.vehicle.remove(name)

    def _lead_on(self) -> None:
        """Give those who are nearly there somewhere else to go: nobody vanishes on the road."""
        vehicles = self._sumo.vehicle
        found = vehicles.getAllSubscriptionResults()
        # Results of the last step still tell of who left in it.
        for name in sorted(found.keys() & set(vehicles.getIDList())):
            index = found[name][_INDEX]
            if found[name][_ROAD].startswith(":"):
                continue  # Within a junction it is decided where it goes.
            if index >= 0 and index >= len(vehicles.getRoute(name)) - 2:
                goal = str(self._rng.choice(self._edges))
                here = vehicles.getRoute(name)[index]
                edges = self._sumo.simulation.findRoute(here, goal, found[name][_TYPE]).edges
                if len(edges) > 2:
                    vehicles.setRoute(name, edges)


def _place_of(net: Path) -> tuple[LocalFrame, Array]:
    """Return the frame of a network and what SUMO adds to places in it."""
    with net.open(encoding="utf-8") as file:
        head = file.read(20_000)
    offset = re.search(r'netOffset="([-0-9.]+),([-0-9.]+)"', head)
    origin = re.search(r"\+proj=tmerc \+lat_0=([-0-9.]+) \+lon_0=([-0-9.]+)", head)
    if offset is None or origin is None:
        raise UserError(f"{net}: says not where on Earth it lies, as foretwin's OpenDRIVE does")
    place = GeoPoint(float(origin[1]), float(origin[2]))
    return LocalFrame(place), np.array([float(offset[1]), float(offset[2])])
