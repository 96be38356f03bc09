"""The futures of a round that runs fewer than were planned, so that rounds take turns with them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from foretwin.contracts.futures import Variant


def some_of(variants: Sequence[Variant], count: int, *, turn: int) -> tuple[Variant, ...]:
    """Return `count` of the variants in their order: the nominal one and a fair mix of the others.

    Those with a scenario and those without keep their shares. Either kind, ordered by the speed
    aimed at, is cut into as many strata as it may have futures, and each stratum gives one: turn
    after turn another, so that all come within a few rounds. Raises ValueError for a count below 1.
    """
    if count < 1:
        raise ValueError(f"{count} futures: at least 1 is needed")
    if count >= len(variants):
        return tuple(variants)
    nominal, *others = variants
    happening = [variant for variant in others if variant.scenario_id]
    alone = [variant for variant in others if not variant.scenario_id]
    share = round((count - 1) * len(happening) / len(others))
    kept = [
        nominal,
        *_one_of_each_stratum(happening, share, turn),
        *_one_of_each_stratum(alone, count - 1 - share, turn),
    ]
    return tuple(sorted(kept, key=lambda variant: variant.index))


def _one_of_each_stratum(variants: list[Variant], count: int, turn: int) -> list[Variant]:
    ordered = sorted(variants, key=lambda variant: (variant.target_speed_factor, variant.index))
    cuts = [len(ordered) * stratum // count for stratum in range(count + 1)] if count else []
    return [ordered[low + turn % (high - low)] for low, high in pairwise(cuts)]
