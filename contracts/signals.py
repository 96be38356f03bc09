"""Lights of a World: heads, what is green together, and the plan by which they change."""

from __future__ import annotations

import msgspec

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import SignalColour
from foretwin.contracts.provenance import Provenance


class Signal(msgspec.Struct, frozen=True, kw_only=True):
    """A signal head that governs lanes; `position` (3,), facing `yaw_rad` (towards the driver)."""

    id: str
    osm_node: int | None
    group_id: str
    lane_ids: tuple[str, ...]
    position: Array
    yaw_rad: float
    source: Provenance
    osm_nodes: tuple[int, ...] = ()
    """All nodes of the map that stand for this light; `osm_node` is the one met first."""


class SignalGroup(msgspec.Struct, frozen=True, kw_only=True):
    """What is green together: connections, and crossings for those on foot; live by this id."""

    id: str
    connection_ids: tuple[str, ...]
    crossing_ids: tuple[str, ...] = ()


class SignalPhase(msgspec.Struct, frozen=True, kw_only=True):
    """A stretch of a cycle in which the named groups are green and all others red."""

    green_s: float
    green_group_ids: tuple[str, ...]


class SignalPlan(msgspec.Struct, frozen=True, kw_only=True):
    """A fixed-time plan: phases in order, each followed by `amber_s` and `all_red_s`.

    Cycles begin `offset_s` after time 0. In the last `red_amber_s` of the red before its green a
    group shows red and amber together. Groups of one phase never conflict, but for turns across
    oncoming traffic, which wait as `Conflict` says. A live `SignalState` overrides it.
    """

    groups: tuple[SignalGroup, ...]
    phases: tuple[SignalPhase, ...]
    amber_s: float
    all_red_s: float
    source: Provenance
    offset_s: float = 0.0
    red_amber_s: float = 0.0


class LearntSignal(msgspec.Struct, frozen=True, kw_only=True):
    """How a group of lights was heard to change, the same cycle again and again.

    A cycle began at `begins_ns` of the vehicle's clock and takes `cycle_s`; `colours` begin
    `from_s` seconds into it, ascending from 0. What was heard of `cycles` whole ones strays from
    this by no more than `spread_s`.
    """

    group_id: str
    begins_ns: int
    cycle_s: float
    from_s: tuple[float, ...]
    colours: tuple[SignalColour, ...]
    cycles: int
    spread_s: float
