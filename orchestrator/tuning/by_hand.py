"""`foretwin set vehicle.NAME=VALUE`: parameters set by hand, pinned, unpinned and rolled back."""

from __future__ import annotations

from dataclasses import dataclass

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.runtime_configuration.handler import Made, RefusedError
from foretwin.orchestrator.tuning.parameter_versions import ParameterVersions
from foretwin.sim_worker.analysis.identify.acceptance import in_force

_WORDS = ("pin", "unpin", "rollback")


@dataclass(frozen=True)
class VehicleHandler:
    """Makes the changes `vehicle.NAME`."""

    parameters: ParameterVersions
    keys: str = "vehicle.NAME"
    at_once: bool = False

    def check(self, name: str, value: str) -> None:
        """Raise RefusedError for an unknown parameter, a word or a number that cannot be."""
        parameters = self.parameters.in_force
        try:
            if value == "rollback":
                parameters.check_rollback(name)
            elif value in _WORDS:
                in_force(parameters.vehicle, name)
            else:
                parameters.check_set(name, _number(value))
        except UserError as refused:
            raise RefusedError(f"vehicle.{name}={value}: {refused}") from refused

    def make(self, name: str, value: str, *, stamp_ns: int) -> Made:
        """Let the parameter count from `stamp_ns` on; raises RefusedError where it cannot."""
        self.check(name, value)
        parameters = self.parameters.in_force
        before = in_force(parameters.vehicle, name)
        if value == "pin":
            parameters.pin(name)
            return Made(f"{before:.6g}", f"{before:.6g}, pinned")
        if value == "unpin":
            parameters.unpin(name)
            return Made(f"{before:.6g}", f"{before:.6g}, not pinned")
        if value == "rollback":
            change = parameters.rollback(name, stamp_ns=stamp_ns)
        else:
            change = parameters.set(name, _number(value), stamp_ns=stamp_ns)
        self.parameters.note([change])
        return Made(f"{before:.6g}", f"{change.value:.6g}, pinned")


def _number(value: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise UserError(f"must be a number, {', '.join(_WORDS[:-1])} or {_WORDS[-1]}") from None
