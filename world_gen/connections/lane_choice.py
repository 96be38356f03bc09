"""Which lanes of a road begin which of its movements: by their arrows, else by where they lie."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import msgspec

from foretwin.contracts.world import DrivingSide, Turn
from foretwin.world_gen.connections.movements import Movement, parts_softly
from foretwin.world_gen.connections.slight_arrows import told_apart
from foretwin.world_gen.lanes.lane_curves import LaneDraft
from foretwin.world_gen.lanes.legs import is_ring_edge

_FROM_LEFT: tuple[Turn, ...] = ("left", "straight", "right")


def lanes_chosen(
    ways: Sequence[Movement],
    starts: list[LaneDraft],
    middle: Sequence[LaneDraft],
    room: Sequence[int],
    beside: int,
    driving_side: DrivingSide,
) -> list[list[LaneDraft]]:
    """Return for each movement of one road the lanes, from the left, from which it begins.

    `starts` are the road's lanes from the left, `middle` those for turns from both directions,
    `room` is the number of lanes that each movement leads to. Where a one-way road forks,
    `beside` is that of the branch straight on, else 0: there one lane at most leads into both.
    Where a road parts softly and no arrow names a branch, the arrows straight on mean it as well,
    and their lanes are shared out as those of a road without arrows.
    A lane that no movement takes up, since its arrow points where the map has no road, leads
    where it turns least from what its arrow says: no lane ends before a junction.
    """
    if len(starts) == 1 and not middle and not _tagged(starts[0]):
        return [starts for _ in ways]
    abreast = (*middle, *starts) if driving_side == "right" else (*starts, *middle)
    order = {lane.id: i for i, lane in enumerate(abreast)}
    parting = _parting(ways, starts)
    found: list[list[LaneDraft]] = []
    for way, its_room in zip(ways, room, strict=True):
        turning = [lane for lane in middle if way.turn in lane.turns]
        if len(ways) == 1 and way.turn != "u_turn":
            found.append([*turning, *starts])
        elif turning:
            named = [lane for lane in starts if _tagged(lane) and way.turn in lane.plan.turns]
            found.append([*turning, *named])
        elif is_ring_edge(way.away.edge):
            found.append(_staying_on_ring(starts, ways, its_room, driving_side))
        else:
            found.append(
                _starting_lanes(way, starts, ways, parting, its_room, beside, driving_side)
            )
    # A movement that the arrows leave no lane is none, even where lanes are left over.
    open_ways = [i for i, lanes in enumerate(found) if lanes and room[i]]
    taken = {lane.id for lanes in found for lane in lanes}
    for lane in abreast:
        if open_ways and lane.id not in taken:
            found[_nearest(lane, order, ways, found, open_ways)].append(lane)
    known = {lane.id: lane for lane in abreast}
    ids = [sorted({lane.id for lane in lanes}, key=order.__getitem__) for lanes in found]
    return [[known[name] for name in mine] for mine in ids]


def _nearest(
    lane: LaneDraft,
    order: Mapping[str, int],
    ways: Sequence[Movement],
    found: Sequence[list[LaneDraft]],
    open_ways: Sequence[int],
) -> int:
    """Return which movement a lane goes with that none has taken up: the one that turns least
    from its arrow, without an arrow that of the lane next to it."""

    def off(i: int) -> tuple[float, float]:
        if _tagged(lane):
            away = min(_apart(turn, ways[i].turn) for turn in lane.plan.turns)
        else:
            away = min(abs(order[its.id] - order[lane.id]) for its in found[i])
        return away, abs(ways[i].angle_rad)

    return min(open_ways, key=off)


def _apart(wanted: Turn, offered: Turn) -> int:
    if "u_turn" in (wanted, offered):
        return 0 if wanted == offered else len(_FROM_LEFT)
    return abs(_FROM_LEFT.index(wanted) - _FROM_LEFT.index(offered))


def _tagged(lane: LaneDraft) -> bool:
    return lane.plan.turns_source == "tagged"


def _parting(ways: Sequence[Movement], starts: Sequence[LaneDraft]) -> frozenset[Turn]:
    """Return the sides to which branches part that no arrow names, beside arrows straight on."""
    named = {turn for lane in starts if _tagged(lane) for turn in lane.plan.turns}
    if "straight" not in named:
        return frozenset()
    unnamed = (way for way in ways if way.turn not in named and way.turn != "u_turn")
    return frozenset(way.turn for way in unnamed if parts_softly(way))


def _staying_on_ring(
    starts: list[LaneDraft],
    ways: Sequence[Movement],
    room: int,
    driving_side: DrivingSide,
) -> list[LaneDraft]:
    """Return the lanes that go on along a ring, or enter it: all whose arrow names not the exit
    alone; of those without arrows the inner ones, as far as they have room beside an exit."""
    if all(is_ring_edge(way.away.edge) for way in ways):
        return list(starts)
    if any(_tagged(lane) for lane in starts):
        # Whatever an arrow names, who does not turn off here stays.
        stay = [n for n in starts if not _tagged(n) or set(n.plan.turns) - {driving_side}]
        return stay or list(starts)
    count = max(room, 1)
    return starts[:count] if driving_side == "right" else starts[-count:]


def named_by_tags(ways: list[Movement], starts: Sequence[LaneDraft]) -> list[Movement]:
    """Let turn lanes correct the names of turns, which angles alone do not determine at forks.

    As many movements as there are tagged turns take them in order from the left; else a turn
    that no lane names takes the name of a tagged one that no other movement took up.
    """
    if not all(_tagged(lane) for lane in starts):
        return ways
    tagged = {turn for lane in starts for turn in lane.plan.turns} - {"u_turn"}
    forward = sorted((m for m in ways if m.turn != "u_turn"), key=lambda m: -m.angle_rad)
    have = {m.turn for m in forward}
    if not tagged or have <= tagged:
        return ways
    if len(forward) == len(tagged):
        named = zip(forward, sorted(tagged, key=_FROM_LEFT.index), strict=True)
        turn_of = {id(m): turn for m, turn in named}
    else:
        turn_of = {id(m): _free_name(m, tagged, have) for m in forward if m.turn not in tagged}
    return [msgspec.structs.replace(m, turn=turn_of.get(id(m), m.turn)) for m in ways]


def _free_name(movement: Movement, tagged: set[Turn], have: set[Turn]) -> Turn:
    side: Turn = "left" if movement.angle_rad > 0 else "right"
    names: tuple[Turn, ...] = (side, "straight")
    return next((name for name in names if name in tagged and name not in have), movement.turn)


def _starting_lanes(
    movement: Movement,
    starts: list[LaneDraft],
    ways: Sequence[Movement],
    parting: Collection[Turn],
    room: int,
    beside: int,
    driving_side: DrivingSide,
) -> list[LaneDraft]:
    """Return the lanes that a movement begins from where a road leads to more than one.

    `parting` are the sides to which lanes part whose arrows point straight on.
    """
    turn = movement.turn
    far: Turn = "left" if driving_side == "right" else "right"
    cars = [lane for lane in starts if lane.kind == "driving"] or starts
    fits, named = cars, 1
    tagged = any(_tagged(lane) for lane in starts)
    parts = turn in parting and parts_softly(movement)
    if tagged:
        meant = {turn, far} if turn == "u_turn" else {"straight" if parts else turn}
        fits = [lane for lane in starts if not _tagged(lane) or meant & set(lane.plan.turns)]
        fits = told_apart(movement, ways, fits)
        named = 1 if parts else sum(_tagged(lane) for lane in fits)
    if turn == "u_turn":
        return _outermost(fits, far)
    if turn != "straight":
        # Lanes without an arrow go straight on; beside a tagged lane those turn that have room.
        with_room = min(room, len(cars) + 1 - beside) if beside else 1
        return _outermost(fits, turn, max(named, with_room))
    have = parting if tagged else {m.turn for m in ways}
    straight = list(fits if tagged else starts)
    # The lane on the far side, from which drivers turn across the road, is the first to be lost.
    sides: list[Turn] = ["left", "right"] if driving_side == "right" else ["right", "left"]
    for side in sides:
        if len(straight) > max(room, 1) and side in have:
            straight = straight[1:] if side == "left" else straight[:-1]
    return straight


def _outermost(lanes: list[LaneDraft], side: Turn, count: int = 1) -> list[LaneDraft]:
    return lanes[:count] if side == "left" else lanes[-count:]
