"""The ego and other road users as entities of an OpenSCENARIO file."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import NamedTuple

from lxml import etree

from foretwin.contracts.drive import RoadUserKind
from foretwin.contracts.scenario import EGO
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.scenarios.roles import StagedActor
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS
from foretwin.world_gen.export.xml_tree import legal, number


def element(
    tag: str, *children: etree._Element, words: str | None = None, **attributes: str | float
) -> etree._Element:
    """Return an element with its children, and with numbers as attributes written out."""
    found = etree.Element(tag)
    found.text = words
    for name, value in attributes.items():
        found.set(name, value if isinstance(value, str) else number(value))
    found.extend(children)
    return found


class ElementMaker:
    """Makes elements by their tags: `make.Center(x=0.0, y=0.0)`."""

    def __getattr__(self, tag: str) -> Callable[..., etree._Element]:
        return functools.partial(element, tag)


make = ElementMaker()


class Axles(NamedTuple):
    """Where a kind of vehicle has its axles, as shares of its length, and how big its wheels are.

    Typical of its kind: they place the reference point, the middle of the rear axle, in the box.
    """

    category: str
    rear_overhang_share: float
    wheelbase_share: float
    wheel_diameter_m: float
    max_steering_rad: float


AXLES: dict[RoadUserKind, Axles] = {
    "car": Axles("car", 0.20, 0.60, 0.63, 0.6),
    "van": Axles("van", 0.22, 0.61, 0.68, 0.6),
    "lorry": Axles("truck", 0.28, 0.53, 0.95, 0.6),
    "bus": Axles("bus", 0.28, 0.49, 0.97, 0.7),
    "tram": Axles("tram", 0.25, 0.50, 0.66, 0.3),
    "motorcycle": Axles("motorbike", 0.15, 0.68, 0.62, 0.7),
    "bicycle": Axles("bicycle", 0.18, 0.58, 0.68, 0.9),
    "unknown": Axles("car", 0.20, 0.60, 0.63, 0.6),
}
_WHEEL_M = 0.63
_TRACK_SHARE = 0.85


def reference_behind_centre_m(kind: RoadUserKind) -> float:
    """Return how far the reference point lies behind the middle of a kind's box."""
    if not KINDS[kind].keeps_lane:
        return 0.0
    return (0.5 - AXLES[kind].rear_overhang_share) * KINDS[kind].length_m


def ego_object(vehicle: VehicleParameters, *, speed_mps: float) -> etree._Element:
    """Return the ego, whose reference point is base_link; it may be as fast as the case has it."""
    length, width = vehicle.length_m.value, vehicle.width_m.value
    entity = make.Vehicle(
        _box(length, width, vehicle.height_m.value, length / 2.0 - vehicle.rear_overhang_m.value),
        make.Performance(
            maxSpeed=max(KINDS["car"].speed_mps, speed_mps),
            maxAcceleration=vehicle.max_drive_accel_mps2.value,
            maxDeceleration=vehicle.max_brake_decel_mps2.value,
        ),
        _axles(vehicle.wheelbase_m.value, width, _WHEEL_M, vehicle.max_tire_angle_rad.value),
        name=EGO,
        vehicleCategory="car",
        mass=vehicle.mass_kg.value,
    )
    return _object(entity, {"vehicle": vehicle.name})


def actor_object(actor: StagedActor) -> etree._Element:
    """Return another road user with the size and limits of its kind, but for what the case asks."""
    traits, length, width = actor.traits, actor.traits.length_m, actor.traits.width_m
    box = _box(length, width, traits.height_m, reference_behind_centre_m(actor.kind))
    if traits.keeps_lane:
        axles = AXLES[actor.kind]
        wheelbase_m, wheel_m = axles.wheelbase_share * length, axles.wheel_diameter_m
        brakes_by = actor.decel_mps2 if actor.conduct == "stops" else 0.0
        entity = make.Vehicle(
            box,
            make.Performance(
                maxSpeed=max(traits.speed_mps, actor.speed_mps),
                maxAcceleration=traits.accel_mps2,
                maxDeceleration=max(traits.hard_decel_mps2, brakes_by),
            ),
            _axles(wheelbase_m, width, wheel_m, axles.max_steering_rad),
            name=actor.name,
            vehicleCategory=axles.category,
            mass=traits.mass_kg,
        )
    else:
        entity = make.Pedestrian(
            box, name=actor.name, mass=traits.mass_kg, pedestrianCategory="pedestrian"
        )
    said = {"kind": actor.kind, "conduct": actor.conduct, "size and limits": traits.source}
    return _object(entity, said)


def properties(said: Mapping[str, str | float]) -> etree._Element:
    """Return words and numbers by name, for readers: simulators leave them alone."""
    values = {name: v if isinstance(v, float) else legal(v) for name, v in said.items()}
    return make.Properties(*(make.Property(name=name, value=v) for name, v in values.items()))


def _object(entity: etree._Element, said: Mapping[str, str]) -> etree._Element:
    entity.append(properties(said))
    return make.ScenarioObject(entity, name=str(entity.get("name")))


def _box(length_m: float, width_m: float, height_m: float, centre_m: float) -> etree._Element:
    return make.BoundingBox(
        make.Center(x=centre_m, y="0", z=height_m / 2.0),
        make.Dimensions(length=length_m, width=width_m, height=height_m),
    )


def _axles(
    wheelbase_m: float, width_m: float, wheel_m: float, max_steering_rad: float
) -> etree._Element:
    rows = ("FrontAxle", wheelbase_m, max_steering_rad), ("RearAxle", 0.0, 0.0)
    wheels = {"wheelDiameter": wheel_m, "trackWidth": _TRACK_SHARE * width_m}
    axles = (
        getattr(make, tag)(maxSteering=angle, **wheels, positionX=ahead, positionZ=wheel_m / 2.0)
        for tag, ahead, angle in rows
    )
    return make.Axles(*axles)
