"""A car of CommonRoad's multi-body model with the numbers of a vehicle file.

What a vehicle file has, the car has; the rest is the BMW 320i's (CommonRoad vehicle 2), with its
masses, springs and dampers scaled by the mass and its lengths by their own, so that it sways as
the 320i does.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

from vehiclemodels.parameters_vehicle2 import parameters_vehicle2

from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.multibody_equations import BODY, GRAVITY_MPS2, TYRE

_BY_MASS = "m_s m_uf m_ur K_sf K_sdf K_sr K_sdr K_ras K_rad K_zt"
_BY_MASS_AND_TRACK = "I_Phi_s K_tsf K_tsr I_uf I_ur"


class MultiBodyNumbers(NamedTuple):
    """Numbers of the equations, in the order of `BODY` and `TYRE`.

    `front_stiffness` and `rear_stiffness` scale the tyres' cornering stiffness, `grip_per_friction`
    makes the tyres' scale of a friction coefficient; `spin_rate_mps2` over the speed is the
    stiffest rate, that with which a wheel takes up the speed of the road. `linkage` says how much
    more the inner front wheel is turned than the outer one: 0 not at all, as in CommonRoad's model,
    1 as both would roll on one circle.
    """

    body: tuple[float, ...]
    tyre: tuple[float, ...]
    front_stiffness: float
    rear_stiffness: float
    grip_per_friction: float
    inertia_factor: float
    spin_rate_mps2: float
    linkage: float = 0.0


@functools.cache
def _bmw_320i() -> Any:
    return parameters_vehicle2()


def multibody_car(vehicle: VehicleParameters) -> MultiBodyNumbers:
    """Return the multi-body car that stands for a vehicle."""
    model = _bmw_320i()
    mass, wheelbase = vehicle.mass_kg.value, vehicle.wheelbase_m.value
    rear = vehicle.cog_from_rear_axle_m.value
    front = wheelbase - rear
    numbers = {name: float(getattr(model, name)) for name in BODY}
    heavier, wider = mass / numbers["m"], vehicle.width_m.value / float(model.w)
    longer = wheelbase / (numbers["a"] + numbers["b"])
    for name in _BY_MASS.split():
        numbers[name] *= heavier
    for name in _BY_MASS_AND_TRACK.split():
        numbers[name] *= heavier * wider**2
    numbers |= {"m": mass, "a": front, "b": rear, "h_s": vehicle.cog_height_m.value}
    numbers |= {"T_f": numbers["T_f"] * wider, "T_r": numbers["T_r"] * wider}
    numbers |= {"I_z": vehicle.yaw_inertia_kgm2.value, "K_lt": numbers["K_lt"] / heavier}
    numbers["I_y_s"] *= heavier * longer**2
    factor = vehicle.wheel_inertia_mass_factor.value
    radius = numbers["R_w"]
    # A factor of 1 would be wheels without inertia, which no integration follows.
    numbers["I_y_w"] = max(factor - 1.0, 0.01) * mass * radius**2 / 4.0
    tyre = {name: float(getattr(model.tire, name)) for name in TYRE}
    loads = [mass * GRAVITY_MPS2 * share / wheelbase for share in (rear, front)]
    given = vehicle.front_cornering_stiffness_npr.value, vehicle.rear_cornering_stiffness_npr.value
    stiffer = [c / (-tyre["p_ky1"] * load) for c, load in zip(given, loads, strict=True)]
    grips = tyre["p_kx1"] * max(loads) / 2.0
    return MultiBodyNumbers(
        body=tuple(numbers[name] for name in BODY),
        tyre=tuple(tyre[name] for name in TYRE),
        front_stiffness=stiffer[0],
        rear_stiffness=stiffer[1],
        grip_per_friction=1.0 / tyre["p_dy1"],
        inertia_factor=factor,
        spin_rate_mps2=grips * radius**2 / numbers["I_y_w"],
    )
