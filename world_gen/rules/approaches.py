"""The roads that enter a junction, each with its signals, its sign and its standing."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import NamedTuple

import msgspec

from foretwin.contracts.provenance import Choice
from foretwin.contracts.world import LineControl, YieldRule
from foretwin.world_gen.connections.lane_connections import ConnectionDraft
from foretwin.world_gen.lanes.cluster import Cluster
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.legs import RING_KINDS, is_ring_edge
from foretwin.world_gen.lanes.stopping import (
    BEFORE_CROSSING_M,
    CROSSING_NEAR_M,
    OWN_LINE_M,
    NodeTags,
)
from foretwin.world_gen.roads.headings import dot, heading_out
from foretwin.world_gen.roads.road_graph import DirectedEdge, EdgeKey
from foretwin.world_gen.roads.road_tags import is_crossed
from foretwin.world_gen.rules.control_devices import (
    Met,
    is_light,
    lights_behind,
    lights_inside,
    met_toward,
    own_sign,
    passed_on,
    sign_of,
)
from foretwin.world_gen.rules.priority_roads import (
    LOOK_M,
    Entry,
    Rank,
    Standing,
    opposites,
    outward,
    standings,
)
from foretwin.world_gen.rules.signs_inside import SignsInside, shared_signs

LIGHT_NEAR_M = 25.0
_SIGN_NEAR_M = 25.0


class Approach(msgspec.Struct, kw_only=True):
    """One leg driven toward a junction, and how it is controlled there.

    `line_m` is where vehicles stop, metres along the leg from its node; None: where lanes end.
    `signal_nodes` are the map's nodes whose light governs it, the first one met first.
    `standing` is how the road ranks where no light decides.
    """

    cluster: Cluster
    toward: DirectedEdge
    control: Choice
    line_m: float | None
    signal_nodes: tuple[int, ...]
    standing: Standing
    opposite: EdgeKey | None = None
    """Key of the approach that lies straight ahead."""
    lit_inside: bool = False
    """Its light stands on the way through the junction, past where a slip road may part."""
    signed_inside: bool = False
    """Its sign stands inside the junction, where all ways from it lead past."""

    @property
    def junction_id(self) -> str:
        """Id of the junction that it leads to."""
        junction = self.cluster.junction
        return junction.summary.id if junction is not None else ""

    @property
    def key(self) -> EdgeKey:
        """(edge index, reverse) of the road as it is driven toward the junction."""
        return self.toward.key


class _ApproachDraft(NamedTuple):
    """What is known of an approach before the junction's roads are compared."""

    cluster: Cluster
    toward: DirectedEdge
    met: list[Met]
    lights: list[Met]
    sign: Met | None
    sign_inside: YieldRule | None


def approaches(
    around: Surroundings,
    node_tags: NodeTags,
    connections: Sequence[ConnectionDraft],
    junction_lights: Collection[int],
    signs: SignsInside,
) -> tuple[Approach, ...]:
    """Return every approach to a whole junction with its control.

    `junction_lights` are the nodes of the lights that are known to govern some junction,
    `signs` what `signs_inside` finds.
    Roads of a ring are approaches only where a light or sign stands on them, ways past it only
    where they have a sign.
    """
    tagged_on = passed_on(around.edges, node_tags)
    inside: dict[EdgeKey, list[Met]] = {}
    for connection in connections:
        if connection.cluster.whole and connection.movement.inside:
            met = inside.setdefault(connection.movement.toward.key, [])
            met.extend(lights_inside(connection.movement.inside, node_tags))
    shared = shared_signs(connections, signs, around.driving_side)
    plain = [cluster for cluster in around.clusters if cluster.plain]
    plain_from = {leg.start_node: cluster for cluster in plain for leg in cluster.legs}
    whole = {id(junction) for junction in around.junctions}
    drafts: dict[str, list[_ApproachDraft]] = {}
    behind: dict[str, list[tuple[int, DirectedEdge]]] = {}
    for cluster in around.clusters:
        junction = cluster.junction
        if junction is None or id(junction) not in whole:
            continue
        signalled = cluster.whole and not cluster.ring and junction.summary.control == "signals"
        for leg in cluster.legs:
            toward = leg.back
            if not toward.allowed:
                passed_out = lights_behind(leg, node_tags, LIGHT_NEAR_M) if signalled else []
                lights_out = [(n, leg) for n in passed_out if n not in junction_lights]
                behind.setdefault(junction.summary.id, []).extend(lights_out)
                continue
            on_ring = cluster.ring and is_ring_edge(leg.edge)
            past_ring = not cluster.ring and leg.edge.index in junction.inner
            if past_ring == cluster.whole:
                continue
            met = met_toward(leg, plain_from, node_tags, junction.nodes, tagged_on)
            lights = [m for m in met if is_light(m.tags) and m.node in junction.lights]
            sign = own_sign(met, toward, cluster, around.edges)
            if on_ring and sign is not None:
                # On a roundabout the ring has the way, and a sign on its node is for who enters.
                stops = junction.summary.kind == "circular" and sign.distance_m > 0.1
                sign = sign if stops else None
            if ((on_ring and not lights) or past_ring) and sign is None:
                continue
            lights = lights or inside.get(toward.key, [])
            if signalled and not lights:
                # A light on a crossing that the finder took for one of walkers alone.
                near = [m for m in met if is_light(m.tags) and m.distance_m <= LIGHT_NEAR_M]
                lights = [m for m in near if m.node not in junction_lights]
            drafts.setdefault(junction.summary.id, []).append(
                _ApproachDraft(cluster, toward, met, lights, sign, shared.get(toward.key))
            )
    found: list[Approach] = []
    for items in drafts.values():
        mine = _compared(items, around)
        _claim_the_rest(mine, behind.get(mine[0].junction_id, []))
        found.extend(mine)
    return tuple(found)


def _claim_the_rest(mine: list[Approach], behind: list[tuple[int, DirectedEdge]]) -> None:
    """Name the junction's other lights with the heads that show the same.

    Lights on the way through go with the nearest road in; those on a one-way road out stop
    no car there, but go with the road in that leads straight to them.
    """
    junction = mine[0].cluster.junction
    lit = [approach for approach in mine if approach.control.value == "signal"]
    if junction is None or not lit:
        return
    known = {node for approach in lit for node in approach.signal_nodes}
    for node in sorted(junction.lights - known):
        on_road = [item for item in lit if node in item.toward.edge.node_ids]
        nearest = (on_road or lit)[0]
        nearest.signal_nodes = (*nearest.signal_nodes, node)
    for node, leg in behind:
        out = heading_out(leg, LOOK_M)
        ahead = min(lit, key=lambda item: dot(out, outward(item.toward)))
        ahead.signal_nodes = (*ahead.signal_nodes, node)


def _compared(drafts: list[_ApproachDraft], around: Surroundings) -> list[Approach]:
    junction = drafts[0].cluster.junction
    assert junction is not None
    kind, control = junction.summary.kind, junction.summary.control
    words: list[YieldRule | None] = [
        sign_of(d.sign.tags) if d.sign else d.sign_inside for d in drafts
    ]
    off_ring = [m for d in drafts if not d.cluster.ring for m in d.met]
    at_node = {sign_of(m.tags) for m in off_ring if m.distance_m <= 0.1} - {None}
    clusters = {d.cluster.key: d.cluster for d in drafts}.values()
    ahead_of = opposites([d.toward for d in drafts], [leg for c in clusters for leg in c.legs])
    entries = [
        Entry(d.toward.edge, word, ahead, leads_on)
        for d, word, (ahead, leads_on) in zip(drafts, words, ahead_of, strict=True)
    ]
    ranks = standings(entries, len(junction.arms), around.driving_side)
    if control == "all_way_stop":
        ranks = [
            rank if word else Standing(Rank.MINOR, "stop", "inferred" if any(words) else "tagged")
            for rank, word in zip(ranks, words, strict=True)
        ]
    elif at_node and not any(words):
        # A sign on the very node belongs to the lesser roads there.
        word: YieldRule = "stop" if "stop" in at_node else "give_way"
        ranks = [Standing(r.rank, word, "inferred") if r.rank <= Rank.MINOR else r for r in ranks]
    ring_has_way = kind == "roundabout" or (
        kind == "circular"
        and any(d.cluster.ring and d.sign and not is_ring_edge(d.toward.edge) for d in drafts)
    )
    lights_for_all = control == "signals" and kind not in RING_KINDS and _for_all(drafts)
    # Where a light holds back the ring, those who enter there have their turn meanwhile.
    ring_waits = {d.cluster.key for d in drafts if d.lights and is_ring_edge(d.toward.edge)}
    found = []
    for d, entry, standing in zip(drafts, entries, ranks, strict=True):
        entering = d.cluster.ring and not is_ring_edge(d.toward.edge)
        if (entering and ring_has_way) or kind == "mini_roundabout":
            source = "tagged" if d.sign or kind != "circular" else "inferred"
            standing = Standing(Rank.MINOR, "roundabout", source)  # type: ignore[arg-type]
        for_all = lights_for_all or d.cluster.key in ring_waits
        approach = _approach(d, standing, control == "signals", for_all)
        if entry.opposite is not None and not d.cluster.ring:
            approach.opposite = drafts[entry.opposite].toward.key
        found.append(approach)
    return found


def _for_all(drafts: list[_ApproachDraft]) -> bool:
    """Return whether lights stop every road in, not only those who would hit pedestrians.

    A single light that is tagged on a crossing before the junction serves that crossing.
    """
    lit = [d for d in drafts if d.lights]
    return (
        len(lit) != 1
        or len(drafts) == 1
        or any(m.distance_m <= OWN_LINE_M or not is_crossed(m.tags) for m in lit[0].lights)
    )


def _approach(d: _ApproachDraft, standing: Standing, signalled: bool, for_all: bool) -> Approach:
    inside = d.sign is None and d.sign_inside is not None
    sign_nearer = (inside or d.sign is not None) and not d.lights
    if signalled and (d.lights or (for_all and not sign_nearer and standing.rank > Rank.YARD)):
        on_leg = [m for m in d.lights if math.isfinite(m.distance_m)]
        far = max(on_leg, key=lambda m: m.distance_m, default=None)
        line = _before_crossing(d.met)
        if far is not None and far.distance_m > OWN_LINE_M:
            line = far.distance_m + (BEFORE_CROSSING_M if is_crossed(far.tags) else 0.0)
        nodes = tuple(dict.fromkeys(m.node for m in d.lights))
        word = Choice("signal", "tagged" if nodes else "inferred")
        lit_inside = bool(d.lights) and not on_leg
    else:
        line, nodes, lit_inside = None, (), False
        if d.sign is not None and OWN_LINE_M < d.sign.distance_m <= _SIGN_NEAR_M:
            line = d.sign.distance_m
        word = Choice("none", "inferred") if inside else _word(standing)
    return Approach(
        cluster=d.cluster,
        toward=d.toward,
        control=word,
        line_m=line,
        signal_nodes=nodes,
        standing=standing,
        lit_inside=lit_inside,
        signed_inside=inside,
    )


def _word(standing: Standing) -> Choice:
    if standing.rank >= Rank.PLAIN:
        return Choice("none", standing.source)
    word: LineControl = "stop" if standing.rule == "stop" else "give_way"
    return Choice(word, standing.source if standing.rule in ("stop", "give_way") else "inferred")


def _before_crossing(met: list[Met]) -> float | None:
    """Return where cars wait for a light before the crossing that they would else block."""
    crossings = [m for m in met if is_crossed(m.tags)]
    at = [m.distance_m for m in crossings if 1.0 < m.distance_m <= CROSSING_NEAR_M]
    return max(at) + BEFORE_CROSSING_M if at else None
