"""The parameters that count: taken from what was identified, set by hand, pinned, rolled back."""

from __future__ import annotations

import functools
from collections import defaultdict, deque

import msgspec

from foretwin.contracts.errors import UserError
from foretwin.contracts.tuning import (
    UNDERSTEER_GRADIENT,
    Identification,
    ParameterChange,
    ParameterEstimate,
    ParameterOrigin,
)
from foretwin.contracts.vehicle import Parameter, VehicleParameters
from foretwin.sim_worker.analysis.identify.acceptance import (
    MUCH_WIDER,
    STIFFNESS,
    accepted,
    in_force,
    is_acceptable,
    std_of,
)
from foretwin.sim_worker.vehicle.parameters import check_vehicle

_ROLLBACKS = 100
"""So many changes of one parameter can be taken back."""


class ParametersInForce:
    """One vehicle's parameters, how they came to be, and which of them stay as they are."""

    def __init__(self, *, vehicle: VehicleParameters, vehicle_id: str) -> None:
        self.vehicle = vehicle
        """The parameters in force."""
        # Windows overlap: what one has told must not weigh as a prior in the next.
        self._given = vehicle
        self.pinned: set[str] = set()
        self._vehicle_id = vehicle_id
        self._taken: dict[str, ParameterEstimate] = {}
        self._before: dict[str, deque[Parameter]] = defaultdict(
            functools.partial(deque[Parameter], (), _ROLLBACKS)
        )

    def _is_pinned(self, name: str) -> bool:
        return name in self.pinned or (name == UNDERSTEER_GRADIENT and STIFFNESS in self.pinned)

    def take(self, result: Identification) -> tuple[ParameterChange, ...]:
        """Let what `result` says count, save where it is pinned or known better; the changes."""
        better = [
            found
            for found in result.estimates
            if is_acceptable(found) and not self._is_pinned(found.name) and self._is_news(found)
        ]
        chosen = msgspec.structs.replace(result, estimates=tuple(better))
        previous = self.vehicle
        self.vehicle, changes = accepted(chosen, self.vehicle)
        names = {change.name for change in changes}
        for found in better:
            if found.name in names or (found.name == UNDERSTEER_GRADIENT and STIFFNESS in names):
                self._taken[found.name] = found
        for name in names:
            self._before[name].append(getattr(previous, name))
        return changes

    def _is_news(self, found: ParameterEstimate) -> bool:
        before = self._taken.get(found.name)
        return before is None or std_of(found) <= MUCH_WIDER * std_of(before)

    def set(self, name: str, value: float, *, stamp_ns: int) -> ParameterChange:
        """Set a parameter by hand and pin it; UserError for a name or value that is none."""
        self.check_set(name, value)
        return self._replace(name, Parameter(value, None, "set by hand"), "set", stamp_ns)

    def check_set(self, name: str, value: float) -> None:
        """Raise UserError, in one line, where `set` would."""
        in_force(self.vehicle, name)
        if name == UNDERSTEER_GRADIENT:
            raise UserError(f"{name} follows from the stiffnesses: set {STIFFNESS}")
        try:
            changed = msgspec.structs.replace(self.vehicle, **{name: Parameter(value)})
            check_vehicle(changed, before=self.vehicle)
        except ValueError as error:
            raise UserError(str(error)) from error

    def pin(self, name: str) -> None:
        """Keep a parameter as it is, whatever is identified; UserError for another name."""
        in_force(self.vehicle, name)
        self.pinned.add(name)

    def unpin(self, name: str) -> None:
        """Let a parameter be identified again; UserError for another name."""
        in_force(self.vehicle, name)
        self.pinned.discard(name)

    def rollback(self, name: str, *, stamp_ns: int) -> ParameterChange:
        """Go back to the value before the last change, and pin it; UserError where none is."""
        self.check_rollback(name)
        earlier = self._before[name][-1]
        change = self._replace(name, earlier, "rolled_back", stamp_ns)
        del self._before[name][-1], self._before[name][-1]
        return change

    def check_rollback(self, name: str) -> None:
        """Raise UserError, in one line, where `rollback` would."""
        in_force(self.vehicle, name)
        if not self._before.get(name):
            raise UserError(f"{name} has not changed: there is nothing to roll back to")

    def _replace(
        self, name: str, parameter: Parameter, origin: ParameterOrigin, stamp_ns: int
    ) -> ParameterChange:
        before: Parameter = getattr(self.vehicle, name)
        try:
            changed = msgspec.structs.replace(self.vehicle, **{name: parameter})
            self.vehicle = check_vehicle(changed, before=self.vehicle)
        except ValueError as error:
            raise UserError(str(error)) from error
        self._before[name].append(before)
        self.pinned.add(name)
        self._given = msgspec.structs.replace(self._given, **{name: parameter})
        self._taken.pop(UNDERSTEER_GRADIENT if name == STIFFNESS else name, None)
        return ParameterChange(
            vehicle_id=self._vehicle_id,
            stamp_ns=stamp_ns,
            name=name,
            before=before.value,
            value=parameter.value,
            std=parameter.std,
            origin=origin,
            pinned=True,
        )
