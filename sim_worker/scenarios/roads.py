"""A World's lanes and connections as a network of ways that road users may take."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.scenario import Relation, TrafficTurn
from foretwin.contracts.world import Connection, DrivingSide, Lane, World
from foretwin.geometry.polyline import apart, arc_lengths, length
from foretwin.sim_worker.scenarios.walls import Walls
from foretwin.sim_worker.scenarios.ways import (
    APPROACH_M,
    DEPARTURE_M,
    Way,
    bend_between,
    heading_of,
    lengthened,
    near_sign,
    traffic_turn,
    turn_by_heading,
)

_LONGEST_CHAIN = 16
"""Connections through one ring: more are a drive in circles."""


class Passage(NamedTuple):
    """A way through one junction: one connection, or on a ring a chain of them.

    Headings are those of the lanes that it comes by and leaves by. `turn` is None for U-turns.
    """

    junction_id: str
    connections: tuple[Connection, ...]
    turn: TrafficTurn | None
    entry_heading_rad: float
    exit_heading_rad: float

    @property
    def name(self) -> str:
        """Return the ids of its connections."""
        return "+".join(connection.id for connection in self.connections)


class RoadNetwork:
    """What a World's lanes offer: passages of its junctions, and the ways that take them."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.driving_side: DrivingSide = world.intersection.driving_side
        self.near_sign = near_sign(self.driving_side)
        self.lanes = {lane.id: lane for lane in world.lanes}
        self.connections = {c.id: c for c in world.connections}
        self.roads = {road.id: road for road in world.roads}
        self._into: dict[str, list[str]] = {}
        self._out_of: dict[str, list[str]] = {}
        for connection in world.connections:
            self._link(connection.from_lane_id, connection.id)
            self._link(connection.id, connection.to_lane_id)
        for lane in world.lanes:
            for successor in lane.successor_ids:
                self._link(lane.id, successor)
        self._passages: dict[str, tuple[Passage, ...]] = {}
        self._ways: dict[str, Way] = {}
        self.walks: dict[tuple[str, Relation, TrafficTurn], tuple[Way, ...]] = {}
        """Those on foot across an arm of a passage, once they were asked for."""

    def _link(self, before: str, after: str) -> None:
        known = self._out_of.setdefault(before, [])
        if after not in known:
            known.append(after)
            self._into.setdefault(after, []).append(before)

    @functools.cached_property
    def walls(self) -> Walls:
        """Return the World's buildings."""
        return Walls(self.world)

    def beside(self, lane: Lane, *, near: bool) -> str | None:
        """Return the lane next to one on the near side, or else the across side, if there is."""
        return lane.right_id if near == (self.near_sign > 0.0) else lane.left_id

    def passages(self, junction_id: str) -> tuple[Passage, ...]:
        """Return the passages for cars through a junction, in the World's order."""
        if junction_id not in self._passages:
            inside = [c for c in self.world.connections if c.junction_id == junction_id]
            # At a roundabout streets also part into their carriageways, and slip roads pass it by.
            on_ring = any(self._ring(c.to_lane_id) for c in inside)
            self._passages[junction_id] = tuple(
                self._passage(junction_id, chain)
                for connection in inside
                if self._car(connection.from_lane_id)
                and not self._ring(connection.from_lane_id)
                and self._ring(connection.to_lane_id) == on_ring
                for chain in self._chains((connection,))
            )
        return self._passages[junction_id]

    def _car(self, lane_id: str) -> bool:
        lane = self.lanes.get(lane_id)
        return lane is not None and lane.kind == "driving"

    def _ring(self, lane_id: str) -> bool:
        return self.lanes[lane_id].role == "ring"

    def _chains(self, chain: tuple[Connection, ...]) -> Iterator[tuple[Connection, ...]]:
        """Yield every way on round the ring until it is left, at most once round."""
        last = chain[-1]
        if not self._car(last.to_lane_id):
            return
        if not self._ring(last.to_lane_id):
            yield chain
            return
        passed = {c.from_lane_id for c in chain} | {last.to_lane_id}
        if len(chain) >= _LONGEST_CHAIN:
            return
        for after in self._after_ring(last.to_lane_id):
            if after.junction_id == last.junction_id and after.to_lane_id not in passed:
                yield from self._chains((*chain, after))

    def _after_ring(self, lane_id: str) -> list[Connection]:
        """Return the connections at the end of a ring's lane, over lanes that merely go on."""
        found = []
        for after in self._out_of.get(lane_id, ()):
            if after in self.connections:
                found.append(self.connections[after])
            elif after in self.lanes and self._ring(after) and after != lane_id:
                on = self._out_of.get(after, ())
                found.extend(self.connections[c] for c in on if c in self.connections)
        return found

    def _passage(self, junction_id: str, chain: tuple[Connection, ...]) -> Passage:
        entry, leave = self._heading(chain[0], at_end=False), self._heading(chain[-1], at_end=True)
        if len(chain) == 1:
            turn = traffic_turn(chain[0].turn, self.driving_side)
        else:
            turn = turn_by_heading(float(wrap_angle(leave - entry)), self.driving_side)
        return Passage(junction_id, chain, turn, entry, leave)

    def _heading(self, connection: Connection, *, at_end: bool) -> float:
        """Return where the lane at an end of a connection heads; the connection if it is short."""
        line = self.lanes[connection.to_lane_id if at_end else connection.from_lane_id].centerline
        if len(line) < 2 or length(line) < 1.0:
            line = connection.centerline[-2:] if at_end else connection.centerline[:2]
        return heading_of(line if at_end else line[::-1], backwards=not at_end)

    def edges_beside(self, lane_id: str) -> tuple[float, float]:
        """Return how far left and right of a lane's middle its road's edges lie, as drivers see it.

        The right one is negative. A lane of no known road reaches half its width.
        """
        lane = self.lanes[lane_id]
        road = self.roads.get(lane.road_id)
        if road is None:
            return float(lane.width_m.value) / 2.0, -float(lane.width_m.value) / 2.0
        left = road.left_m - lane.left_of_reference_m
        right = road.right_m - lane.left_of_reference_m
        return (-right, -left) if lane.reverse else (left, right)

    def classes_of(self, passage: Passage) -> tuple[str, ...]:
        """Return the classes of the roads that a passage comes by and leaves by."""
        ends = passage.connections[0].from_lane_id, passage.connections[-1].to_lane_id
        roads = (self.roads.get(self.lanes[lane].road_id) for lane in ends)
        return tuple(road.road_class for road in roads if road is not None)

    def lanes_to_kerb(self, passage: Passage) -> int:
        """Return how many lanes driven the same way lie between a passage's entry and the kerb."""
        lane, count = self.lanes[passage.connections[0].from_lane_id], 0
        while count < len(self.lanes):
            near = self.beside(lane, near=True)
            if near is None or near not in self.lanes:
                break
            lane, count = self.lanes[near], count + 1
        return count

    def way(self, passage: Passage) -> Way:
        """Return the way that takes a passage, led back and on along the lanes around it."""
        if passage.name not in self._ways:
            ids = [passage.connections[0].id]
            for before, after in zip(passage.connections, passage.connections[1:], strict=False):
                ids.extend(self._between(before, after))
            self._ways[passage.name] = self.way_along(
                passage.name,
                before=self._led(passage.connections[0].from_lane_id, back=True),
                middle=ids,
                after=self._led(passage.connections[-1].to_lane_id, back=False),
            )
        return self._ways[passage.name]

    def way_round(self, entering: Connection) -> Way | None:
        """Return the way of who circulates where `entering` joins the ring; None where none does.

        It comes round as often as it is long, and goes on round the ring.
        """
        name = f"ring>{entering.id}"
        if name not in self._ways:
            ring = entering.to_lane_id
            back = self._round(ring, self._into, APPROACH_M, entering)
            if not back:
                return None
            on = self._round(ring, self._out_of, DEPARTURE_M, entering)
            self._ways[name] = self.way_along(
                name, before=back[:0:-1], middle=back[:1], after=[ring, *on]
            )
        return self._ways[name]

    def _round(
        self, lane_id: str, links: dict[str, list[str]], length_m: float, entering: Connection
    ) -> list[str]:
        """Return what follows on a ring's lane by `links`, for so many metres, nearest first."""
        chain: list[str] = []
        last, walked = lane_id, 0.0
        while walked < length_m:
            onward = [i for i in links.get(last, ()) if self._on_ring(i, entering)]
            if not onward:
                break
            last = onward[0]
            chain.append(last)
            walked += max(0.5, length(self.line(last)))
        return chain

    def _on_ring(self, id_: str, entering: Connection) -> bool:
        if id_ in self.lanes:
            return self._ring(id_)
        connection = self.connections[id_]
        ring = self._ring(connection.from_lane_id) and self._ring(connection.to_lane_id)
        return ring and connection.junction_id == entering.junction_id

    def way_along(
        self, name: str, *, before: Sequence[str], middle: Sequence[str], after: Sequence[str]
    ) -> Way:
        """Return the way along lanes and connections; `middle` is what lies in the junction."""
        parts = [self.line(i) for i in (*before, *middle, *after)]
        limits = [np.full(len(self.line(i)), self.limit_mps(i)) for i in (*before, *middle, *after)]
        xy, limit = np.concatenate(parts), np.concatenate(limits)
        keep = apart(xy, tolerance_m=0.02)
        count = sum(len(part) for part in parts[: len(before)])
        inside = sum(len(part) for part in parts[len(before) : len(before) + len(middle)])
        arc_all = arc_lengths(xy)
        entry = float(arc_all[count]) if middle else float(arc_all[-1])
        exit_ = float(arc_all[count + inside - 1]) if middle else entry
        # One point lies where a part ends and the next begins: from there on, the next one counts.
        kept = np.flatnonzero(keep)
        xy, limit = xy[kept], limit[np.append(kept[1:], len(xy)) - 1]
        return lengthened(name, xy, limit, entry, exit_)

    def _between(self, before: Connection, after: Connection) -> list[str]:
        """Return what leads from one connection of a ring to the next, the next included."""
        lane = before.to_lane_id
        if lane == after.from_lane_id:
            return [lane, after.id]
        return [lane, after.from_lane_id, after.id]

    def line(self, id_: str) -> Array:
        """Return the middle (N, 2) of a lane or connection."""
        return (self.lanes.get(id_) or self.connections[id_]).centerline

    def limit_mps(self, id_: str) -> float:
        """Return the speed limit of a lane, or of the one that a connection comes from."""
        lane = self.lanes.get(id_) or self.lanes[self.connections[id_].from_lane_id]
        return float(lane.speed_limit_mps.value)

    def _led(self, lane_id: str, *, back: bool) -> list[str]:
        """Return a lane and what leads to it, or on from it, the straightest way, in its order."""
        links, far_m = (self._into, APPROACH_M) if back else (self._out_of, DEPARTURE_M)
        chain, walked = [lane_id], length(self.line(lane_id))

        def bend(id_: str) -> float:
            lines = self.line(chain[-1]), self.line(id_)
            return bend_between(*(lines[::-1] if back else lines))

        while walked < far_m:
            more = [i for i in links.get(chain[-1], ()) if i not in chain and self.drivable(i)]
            if not more:
                break
            chain.append(min(more, key=bend))
            walked += length(self.line(chain[-1]))
        return chain[::-1] if back else chain

    def after(self, id_: str) -> tuple[str, ...]:
        """Return the lanes and connections that begin where a lane or connection ends."""
        return tuple(self._out_of.get(id_, ()))

    def drivable(self, id_: str) -> bool:
        """Whether a lane or connection is for cars."""
        if id_ in self.lanes:
            return self._car(id_)
        return id_ in self.connections and self._car(self.connections[id_].from_lane_id)

    def lane_way(self, lane: Lane) -> Way:
        """Return the way along a lane of an open road; it counts as within no junction."""
        back, on = self._led(lane.id, back=True), self._led(lane.id, back=False)[1:]
        return self.way_along(lane.id, before=back[:-1], middle=[lane.id], after=on)
