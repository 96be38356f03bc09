"""What a slight arrow means beside a plain one of the same side: the way that turns less."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import msgspec

from foretwin.contracts.world import Turn
from foretwin.world_gen.connections.movements import Movement
from foretwin.world_gen.lanes.lane_curves import LaneDraft

_SIDES: tuple[Turn, ...] = ("left", "right")


def read_as_straight(ways: Sequence[Movement], starts: Sequence[LaneDraft]) -> None:
    """Let slight arrows of a road's lanes mean the way straight on, where no other lane leads it.

    That is where plain arrows of that side name its only turn to that side.
    """
    turns = [way.turn for way in ways]
    ahead = any("straight" in lane.plan.turns or not lane.plan.arrows for lane in starts)
    if "straight" not in turns or ahead:
        return
    for side in _SIDES:
        slight, plain = f"slight_{side}", _plain(side)
        if turns.count(side) != 1 or not _both(slight, plain, starts):
            continue
        for lane in starts:
            if slight in lane.plan.arrows:
                onward = _onward(lane.plan.turns, side, kept=bool(plain & set(lane.plan.arrows)))
                lane.plan = msgspec.structs.replace(lane.plan, turns=onward)
                lane.turns = onward


def told_apart(
    way: Movement, ways: Sequence[Movement], lanes: Sequence[LaneDraft]
) -> list[LaneDraft]:
    """Return the lanes that mean a movement, of those whose arrows point to its side.

    Where slight and plain arrows point to several movements of one side, the slight ones mean the
    one that turns least, and the plain ones the others.
    """
    alike = [other for other in ways if other.turn == way.turn]
    slight, plain = f"slight_{way.turn}", _plain(way.turn)
    if len(alike) < 2 or not _both(slight, plain, lanes):
        return list(lanes)
    least = min(alike, key=lambda other: abs(other.angle_rad))
    mine = {slight} if way is least else plain
    return [lane for lane in lanes if not lane.plan.arrows or mine & set(lane.plan.arrows)]


def _plain(side: Turn) -> set[str]:
    return {side, f"sharp_{side}"}


def _both(slight: str, plain: set[str], lanes: Iterable[LaneDraft]) -> bool:
    words = {word for lane in lanes for word in lane.plan.arrows}
    return slight in words and bool(plain & words)


def _onward(turns: tuple[Turn, ...], side: Turn, *, kept: bool) -> tuple[Turn, ...]:
    others = (turn for turn in turns if kept or turn != side)
    return tuple(dict.fromkeys((*others, "straight")))
