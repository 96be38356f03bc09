"""The three kinds of vehicle in an SDFormat world: twin, shadow and ghost.

As in Vlasak et al., Low Fidelity Digital Twin for Automated Driving Systems (2024): a twin is a
vehicle with physics, Ackermann steering and a GPS sensor; a shadow follows the pose of the real
vehicle and can be run into; a ghost is a shadow that collides with nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.polyline import direction_at, length, points_at
from foretwin.geometry.world_heights import heights_of
from foretwin.world_gen.export.choices import Simulator, VehicleKind
from foretwin.world_gen.export.sdformat_plugins import ackermann_plugin, gps_sensor
from foretwin.world_gen.export.sdformat_shapes import numbers, pose, shaped
from foretwin.world_gen.export.solids import Rgba
from foretwin.world_gen.export.xml_tree import Element, child, leaves

WHEEL_RADIUS_M, WHEEL_WIDTH_M = 0.33, 0.2
"""Assumed, as vehicle parameters do not have them: a 205/55 R16 tyre, rounded."""
WHEEL_SHARE, KNUCKLE_SHARE = 0.018, 0.009
"""Assumed shares of the mass of one wheel and of one steering knuckle."""
GROUND_CLEARANCE_M = 0.18
STEERING_DAMPING_NMSPRAD = 100.0
"""Damps the wheels' angle to half of critical: the drive plugin itself has no damping."""
LEFT, UP = "0 1 0", "0 0 1"
FREE = {"lower": "-1e16", "upper": "1e16"}
_GAP_M = 10.0
_COLOURS: dict[str, Rgba] = {
    "twin": (0.15, 0.6, 0.2, 1.0),
    "shadow": (0.15, 0.35, 0.85, 0.75),
    "ghost": (0.85, 0.85, 0.9, 0.4),
}
_TYRE: Rgba = (0.08, 0.08, 0.08, 1.0)


_DROP_M = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class SdfVehicle:
    """One vehicle of a world: its kind, and where base_link (the rear axle's centre) begins."""

    name: str
    kind: VehicleKind
    parameters: VehicleParameters
    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    z_m: float = 0.0


def place_vehicles(
    world: World, named: Sequence[tuple[str, VehicleKind]], parameters: VehicleParameters
) -> tuple[SdfVehicle, ...]:
    """Stand vehicles on the lanes towards the junction: at their beginnings, then behind them.

    Vehicles for which the lanes have no room stand in a row from the origin to the east.
    """
    into = {c.from_lane_id for c in world.connections if c.junction_id == world.intersection.id}
    every = [lane for lane in world.lanes if lane.role == "approach" and lane.kind == "driving"]
    lanes = [lane.centerline for lane in every if lane.id in into]
    lanes = sorted(lanes or [lane.centerline for lane in every], key=length, reverse=True)
    behind = parameters.rear_overhang_m.value + 1.0
    ahead = parameters.length_m.value - parameters.rear_overhang_m.value
    room = [
        (line, behind + row * _GAP_M)
        for row in range(len(named))
        for line in lanes
        if behind + row * _GAP_M + ahead <= length(line)
    ]
    vehicles, hills = [], heights_of(world)
    for number, (name, kind) in enumerate(named):
        x, y, yaw = number * _GAP_M, 0.0, 0.0
        if number < len(room):
            line, s = room[number]
            (x, y), heading = points_at(line, s), direction_at(line, s)
            yaw = math.atan2(heading[1], heading[0])
        at = {"x_m": float(x), "y_m": float(y), "yaw_rad": yaw}
        if hills is not None:
            # Level above a slope: it falls as far as its front axle is higher than its rear one.
            places = np.array([[x, y], np.add((x, y), ahead * np.array(_heading(yaw)))])
            at["z_m"] = float(hills.surface_at(places).max()) + _DROP_M
        vehicles.append(SdfVehicle(name=name, kind=kind, parameters=parameters, **at))
    return tuple(vehicles)


def _heading(yaw_rad: float) -> tuple[float, float]:
    return math.cos(yaw_rad), math.sin(yaw_rad)


def add_vehicle(parent: Element, vehicle: SdfVehicle, simulator: Simulator) -> None:
    """Add a vehicle to a world; its model's frame is base_link."""
    model = child(parent, "model", name=vehicle.name)
    pose(model, vehicle.x_m, vehicle.y_m, vehicle.z_m, vehicle.yaw_rad)
    if vehicle.kind == "twin":
        _add_twin(model, vehicle, simulator)
    else:
        _add_shadow(model, vehicle)


def _add_shadow(model: Element, vehicle: SdfVehicle) -> None:
    """Add a body that nothing pushes and nothing pulls down: it stands where it is put."""
    link = child(model, "link", name="base_link")
    _body(link, vehicle, solid=vehicle.kind == "shadow")
    car = vehicle.parameters
    mass = car.mass_kg.value
    inertia = _box_inertia(car, mass, car.yaw_inertia_kgm2.value)
    _inertial(link, mass, car.cog_from_rear_axle_m.value, car.cog_height_m.value, inertia)
    leaves(link, {"gravity": "0", "kinematic": "1"})


def _add_twin(model: Element, vehicle: SdfVehicle, simulator: Simulator) -> None:
    car = vehicle.parameters
    mass, wheelbase = car.mass_kg.value, car.wheelbase_m.value
    wheel_kg, knuckle_kg = WHEEL_SHARE * mass, KNUCKLE_SHARE * mass
    half_track = track_width_m(car) / 2
    front_kg = 2 * (wheel_kg + knuckle_kg)
    body_kg = mass - front_kg - 2 * wheel_kg
    # The parts together have the mass, centre of gravity and yaw inertia of the parameters.
    cog_x = (mass * car.cog_from_rear_axle_m.value - front_kg * wheelbase) / body_kg
    low_kg = front_kg + 2 * wheel_kg
    cog_z = (mass * car.cog_height_m.value - low_kg * WHEEL_RADIUS_M) / body_kg
    cog = car.cog_from_rear_axle_m.value
    rest = (
        front_kg * ((wheelbase - cog) ** 2 + half_track**2)
        + 2 * wheel_kg * (cog**2 + half_track**2)
        + body_kg * (cog_x - cog) ** 2
    )
    yaw_inertia = max(car.yaw_inertia_kgm2.value - rest, 0.2 * car.yaw_inertia_kgm2.value)
    body = child(model, "link", name="base_link")
    _body(body, vehicle, solid=True)
    _inertial(body, body_kg, cog_x, cog_z, _box_inertia(car, body_kg, yaw_inertia))
    gps_sensor(body, vehicle.name, simulator, above_m=car.height_m.value)
    hardest = max(car.max_drive_accel_mps2.value, car.max_brake_decel_mps2.value)
    driven = FREE | {"effort": numbers(mass * WHEEL_RADIUS_M / 2 * hardest)}
    reach = numbers(steering_limit_rad(car), digits=4)
    steered = {"lower": f"-{reach}", "upper": reach}
    steered["velocity"] = numbers(car.max_tire_rate_radps.value)
    for side, y in (("left", half_track), ("right", -half_track)):
        rear, front, held = f"rear_{side}_wheel", f"front_{side}_wheel", f"front_{side}_knuckle"
        _wheel(model, rear, 0.0, y, wheel_kg, car.friction.value)
        _hinge(model, (f"{rear}_joint", "base_link", rear), driven)
        knuckle = child(model, "link", name=held)
        pose(knuckle, wheelbase, y, WHEEL_RADIUS_M)
        _inertial(knuckle, knuckle_kg, 0.0, 0.0, (0.2, 0.2, 0.2))
        turning = f"front_{side}_steer_joint", "base_link", held
        axis = _hinge(model, turning, steered, axis=UP)
        child(child(axis, "dynamics"), "damping", numbers(STEERING_DAMPING_NMSPRAD))
        _wheel(model, front, wheelbase, y, wheel_kg, car.friction.value)
        _hinge(model, (f"{front}_joint", held, front), FREE)
    ackermann_plugin(
        model, vehicle.name, car, simulator, wheel_radius_m=WHEEL_RADIUS_M, track_m=2 * half_track
    )


def track_width_m(car: VehicleParameters) -> float:
    """Distance between the middles of an axle's wheels, their outsides flush with the body."""
    return car.width_m.value - WHEEL_WIDTH_M


def steering_limit_rad(car: VehicleParameters) -> float:
    """Largest angle of the inner front wheel, by Ackermann's rule from that of a bicycle."""
    tan = math.tan(car.max_tire_angle_rad.value)
    return math.atan2(tan, 1.0 - track_width_m(car) / (2 * car.wheelbase_m.value) * tan)


def _body(link: Element, vehicle: SdfVehicle, *, solid: bool) -> None:
    car = vehicle.parameters
    high = car.height_m.value - GROUND_CLEARANCE_M
    centre = car.length_m.value / 2 - car.rear_overhang_m.value, 0.0, GROUND_CLEARANCE_M + high / 2
    # The wheels of a twin stand within its box: links of one model do not collide.
    size = [("size", numbers(car.length_m.value, car.width_m.value, high))]
    if solid:
        shaped(child(link, "collision", name="body.collision"), "box", size, centre)
    visual = child(link, "visual", name="body.visual")
    shaped(visual, "box", size, centre, _COLOURS[vehicle.kind])


def _box_inertia(
    car: VehicleParameters, mass_kg: float, yaw_inertia_kgm2: float
) -> tuple[float, float, float]:
    roll = mass_kg / 12.0 * (car.width_m.value**2 + car.height_m.value**2)
    return roll, yaw_inertia_kgm2, yaw_inertia_kgm2


def _inertial(
    link: Element, mass_kg: float, x_m: float, z_m: float, inertia: tuple[float, float, float]
) -> None:
    inertial = child(link, "inertial")
    pose(inertial, x_m, 0.0, z_m)
    child(inertial, "mass", numbers(mass_kg))
    tensor = child(inertial, "inertia")
    xx, yy, zz = (numbers(value, digits=4) for value in inertia)
    leaves(tensor, {"ixx": xx, "ixy": "0", "ixz": "0", "iyy": yy, "iyz": "0", "izz": zz})


def _wheel(model: Element, name: str, x: float, y: float, mass_kg: float, friction: float) -> None:
    link = child(model, "link", name=name)
    pose(link, x, y, WHEEL_RADIUS_M)
    spin = 0.5 * mass_kg * WHEEL_RADIUS_M**2
    tilt = mass_kg / 12.0 * (3 * WHEEL_RADIUS_M**2 + WHEEL_WIDTH_M**2)
    _inertial(link, mass_kg, 0.0, 0.0, (tilt, spin, tilt))
    size = [("radius", numbers(WHEEL_RADIUS_M)), ("length", numbers(WHEEL_WIDTH_M))]
    for tag in ("collision", "visual"):
        part = child(link, tag, name=f"tyre.{tag}")
        child(part, "pose", f"0 0 0 {numbers(np.pi / 2, digits=6)} 0 0")
        shaped(part, "cylinder", size, rgba=_TYRE if tag == "visual" else None)
        if tag == "collision":
            surface, grip = child(part, "surface"), numbers(friction)
            leaves(child(child(surface, "friction"), "ode"), {"mu": grip, "mu2": grip})
            stiff = {"kp": "1e7", "kd": "1e3", "min_depth": "0.001"}
            leaves(child(child(surface, "contact"), "ode"), stiff)


def _hinge(
    model: Element, between: tuple[str, str, str], limit: Mapping[str, str], *, axis: str = LEFT
) -> Element:
    """Add a joint, its name `between` those of its parent and its child, and return its axis."""
    name, parent, of = between
    joint = child(model, "joint", name=name, type="revolute")
    leaves(joint, {"parent": parent, "child": of})
    element = child(joint, "axis")
    child(element, "xyz", axis)
    leaves(child(element, "limit"), limit)
    return element
