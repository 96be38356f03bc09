"""Roles of the vehicles and the correction of their twins: what counts, and who is told."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from foretwin.contracts.roles import CORRECTIONS, ROLES, Correction, Role, UseRoles
from foretwin.orchestrator.runtime_configuration.handler import ChangeHandler, Made, RefusedError


class RolesInForce:
    """The roles and the correction that count now; `tell` hands them to the mirror.

    The first of the roles is the car's own.
    """

    def __init__(
        self,
        roles: Mapping[str, Role],
        correction: Correction,
        *,
        tell: Callable[[UseRoles], None],
    ) -> None:
        self.roles = dict(roles)
        self.correction: Correction = correction
        self._tell = tell

    def announce(self, stamp_ns: int) -> None:
        """Tell the mirror what counts from `stamp_ns` on."""
        self._tell(UseRoles(stamp_ns=stamp_ns, roles=dict(self.roles), correction=self.correction))


@dataclass(frozen=True)
class RoleHandler:
    """Makes the changes `role.ID`."""

    in_force: RolesInForce
    keys: str = "role.ID"
    at_once: bool = False

    def check(self, name: str, value: str) -> None:
        """Raise RefusedError for an unknown vehicle or role."""
        if name not in self.in_force.roles:
            known = ", ".join(self.in_force.roles)
            raise RefusedError(f"role.{name}: no such vehicle in this drive; there are: {known}")
        own = next(iter(self.in_force.roles))
        choices = [role for role in ROLES if role != "all" or name == own]
        if value not in choices:
            raise RefusedError(f"role.{name}={value}: must be {', '.join(choices)}")

    def make(self, name: str, value: str, *, stamp_ns: int) -> Made:
        """Give the vehicle its new role from `stamp_ns` on."""
        before = self.in_force.roles[name]
        self.in_force.roles[name] = next(role for role in ROLES if role == value)
        self.in_force.announce(stamp_ns)
        return Made(before, value)


@dataclass(frozen=True)
class CorrectionHandler:
    """Makes the change `correction`."""

    in_force: RolesInForce
    keys: str = "correction"
    at_once: bool = False

    def check(self, name: str, value: str) -> None:
        """Raise RefusedError for an unknown correction."""
        if name or value not in CORRECTIONS:
            key = f"correction.{name}" if name else "correction"
            choices = " or ".join(f"correction={one}" for one in CORRECTIONS)
            raise RefusedError(f"{key}={value}: must be {choices}")

    def make(self, name: str, value: str, *, stamp_ns: int) -> Made:
        """Let twins follow or run free from `stamp_ns` on."""
        before = self.in_force.correction
        self.in_force.correction = next(one for one in CORRECTIONS if one == value)
        self.in_force.announce(stamp_ns)
        return Made(before, value)


def role_changes(in_force: RolesInForce) -> dict[str, ChangeHandler]:
    """Return what makes changes of roles and of the correction, by the first part of their keys."""
    return {"role": RoleHandler(in_force), "correction": CorrectionHandler(in_force)}
