"""The futures of a round that runs fewer than were planned, so that rounds take turns with them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from foretwin.contracts.futures import Future


def some_of(
    futures: Sequence[Future], count: int, *, turn: int, first: Sequence[Future] = ()
) -> tuple[Future, ...]:
    """Return `count` of the futures in their order: the nominal one and a fair mix of the others.

    Half of the others' places go to those of `first` that are among them, in that order. In what
    is left, those with a scenario and those without keep their shares. Either kind, ordered by the
    speed aimed at, is cut into as many strata as it may have futures, and each stratum gives one:
    turn after turn another, so that all come within a few rounds. Raises ValueError for a count
    below 1.
    """
    if count < 1:
        raise ValueError(f"{count} futures: at least 1 is needed")
    if count >= len(futures):
        return tuple(futures)
    nominal, *others = futures
    known = {future.index: future for future in others}
    # Of another junction, a future of the same number is another one.
    again = [future for future in first if known.get(future.index) == future][: (count - 1) // 2]
    taken = {future.index for future in again}
    others = [future for future in others if future.index not in taken]
    happening = [future for future in others if future.scenario_id]
    alone = [future for future in others if not future.scenario_id]
    left = count - 1 - len(again)
    share = round(left * len(happening) / len(others))
    kept = [
        nominal,
        *again,
        *_one_of_each_stratum(happening, share, turn),
        *_one_of_each_stratum(alone, left - share, turn),
    ]
    return tuple(sorted(kept, key=lambda future: future.index))


def _one_of_each_stratum(futures: list[Future], count: int, turn: int) -> list[Future]:
    ordered = sorted(futures, key=_by_speed)
    cuts = [len(ordered) * stratum // count for stratum in range(count + 1)] if count else []
    return [ordered[low + turn % (high - low)] for low, high in pairwise(cuts)]


def _by_speed(future: Future) -> tuple[float, int]:
    return future.numbers.get("target_speed_factor", 1.0), future.index
