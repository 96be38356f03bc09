"""Between the steering wheel and the tyres: a ratio, and an offset that is added at the tyres."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters

LEAST_RADIUS_M = 4.0
"""Of base_link's path: cars turn hardly tighter. Chosen: passenger cars' turning circles are 10 to
12 m across from kerb to kerb, as the outer front wheel goes; those of base_link some 8 m."""
MAX_CURVATURE_PM = 1.0 / LEAST_RADIUS_M
"""1/m, the same."""
DRIVEN_CURVATURE_PM = 0.18
"""1/m, of base_link: as tight as ways are laid that cars are to drive along. Chosen: between
MAX_CURVATURE_PM and this lies the steering with which who drives them comes back onto them."""
LEAST_GRID_RADIUS_M = 0.95 * LEAST_RADIUS_M
"""The same of paths whose points lie on the millimetre grid: these bend a little more than the
curves that they stand for."""

_Angle = TypeVar("_Angle", float, Array)


class SteeringColumn(NamedTuple):
    """How tyre angles follow from steering-wheel angles, both in radians, positive to the left."""

    ratio: float
    """Steering wheel over tyre."""
    offset_rad: float
    """Of the tyres where the wheel is straight."""

    def tire_rad(self, wheel_rad: _Angle) -> _Angle:
        """Return the tyre angle that a steering-wheel angle means."""
        return wheel_rad / self.ratio + self.offset_rad

    def wheel_rad(self, tire_rad: _Angle) -> _Angle:
        """Return the steering-wheel angle that belongs to a tyre angle."""
        return (tire_rad - self.offset_rad) * self.ratio


def column_of(vehicle: VehicleParameters) -> SteeringColumn:
    """Return the steering column of a vehicle."""
    return SteeringColumn(vehicle.steering_ratio.value, vehicle.steering_offset_rad.value)
