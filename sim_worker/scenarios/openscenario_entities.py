"""The ego and other road users as entities of an OpenSCENARIO file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from lxml import etree

from foretwin.contracts.drive import RoadUserKind
from foretwin.contracts.scenario import EGO
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.scenarios.roles import CastActor
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS
from foretwin.world_gen.export.xml_tree import legal, number


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


def ego_object(vehicle: VehicleParameters) -> etree._Element:
    """Return the ego, whose reference point is base_link."""
    length = vehicle.length_m.value
    entity = _vehicle(EGO, "car", vehicle.mass_kg.value)
    _box(
        entity, length, vehicle.width_m.value, vehicle.height_m.value,
        centre_m=length / 2.0 - vehicle.rear_overhang_m.value,
    )  # fmt: skip
    _performance(
        entity, KINDS["car"].speed_mps, vehicle.max_drive_accel_mps2.value,
        vehicle.max_brake_decel_mps2.value,
    )  # fmt: skip
    _axles(
        entity, vehicle.wheelbase_m.value, vehicle.width_m.value, _WHEEL_M,
        vehicle.max_tire_angle_rad.value,
    )  # fmt: skip
    return _object(entity, {"vehicle": vehicle.name})


def actor_object(actor: CastActor) -> etree._Element:
    """Return another road user with the size and limits of its kind."""
    traits = actor.traits
    said = {"kind": actor.kind, "conduct": actor.conduct, "size and limits": traits.source}
    if not traits.keeps_lane:
        entity = etree.Element(
            "Pedestrian", name=actor.name, mass=number(traits.mass_kg),
            pedestrianCategory="pedestrian",
        )  # fmt: skip
        _box(entity, traits.length_m, traits.width_m, traits.height_m, centre_m=0.0)
        return _object(entity, said)
    axles = AXLES[actor.kind]
    entity = _vehicle(actor.name, axles.category, traits.mass_kg)
    _box(
        entity, traits.length_m, traits.width_m, traits.height_m,
        centre_m=reference_behind_centre_m(actor.kind),
    )  # fmt: skip
    _performance(entity, traits.speed_mps, traits.accel_mps2, traits.hard_decel_mps2)
    _axles(
        entity, axles.wheelbase_share * traits.length_m, traits.width_m, axles.wheel_diameter_m,
        axles.max_steering_rad,
    )  # fmt: skip
    return _object(entity, said)


def _object(entity: etree._Element, said: Mapping[str, str]) -> etree._Element:
    properties = etree.SubElement(entity, "Properties")
    for name, words in said.items():
        etree.SubElement(properties, "Property", name=name, value=legal(words))
    found = etree.Element("ScenarioObject", name=str(entity.get("name")))
    found.append(entity)
    return found


def _vehicle(name: str, category: str, mass_kg: float) -> etree._Element:
    return etree.Element("Vehicle", name=name, vehicleCategory=category, mass=number(mass_kg))


def _box(
    entity: etree._Element, length_m: float, width_m: float, height_m: float, *, centre_m: float
) -> None:
    box = etree.SubElement(entity, "BoundingBox")
    etree.SubElement(box, "Center", x=number(centre_m), y="0", z=number(height_m / 2.0))
    etree.SubElement(
        box, "Dimensions", length=number(length_m), width=number(width_m), height=number(height_m)
    )


def _performance(
    entity: etree._Element, speed_mps: float, accel_mps2: float, decel_mps2: float
) -> None:
    etree.SubElement(
        entity, "Performance", maxSpeed=number(speed_mps), maxAcceleration=number(accel_mps2),
        maxDeceleration=number(decel_mps2),
    )  # fmt: skip


def _axles(
    entity: etree._Element,
    wheelbase_m: float,
    width_m: float,
    wheel_m: float,
    max_steering_rad: float,
) -> None:
    axles = etree.SubElement(entity, "Axles")
    for tag, ahead_m, steering in (
        ("FrontAxle", wheelbase_m, max_steering_rad), ("RearAxle", 0.0, 0.0),
    ):  # fmt: skip
        etree.SubElement(
            axles, tag, maxSteering=number(steering), wheelDiameter=number(wheel_m),
            trackWidth=number(_TRACK_SHARE * width_m), positionX=number(ahead_m),
            positionZ=number(wheel_m / 2.0),
        )  # fmt: skip
