"""The kind of a junction does not depend on which way the map is turned, or on its mirror image."""

from __future__ import annotations

import tempfile
from pathlib import Path

from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.world_gen.sketch import only, star

GAPS_DEG = st.lists(st.integers(4, 30), min_size=3, max_size=6).map(
    lambda parts: [360.0 * part / sum(parts) for part in parts]
)


def _kind(gaps_deg: list[float], turned_deg: float, *, mirrored: bool = False) -> tuple[str, int]:
    bearings, here = [], turned_deg
    for gap in gaps_deg:
        bearings.append(-here if mirrored else here)
        here += gap
    with tempfile.TemporaryDirectory() as folder:
        summary = only(star(bearings).junctions(Path(folder))).summary
    return summary.kind, summary.arms


@settings(max_examples=40)
@given(GAPS_DEG, st.floats(0.0, 360.0))
def test_turned_and_mirrored_maps_have_junctions_of_one_kind(
    gaps_deg: list[float], turned_deg: float
) -> None:
    # Half a degree off every limit: a turned sketch is rounded to the map's digits.
    straight = [abs(180.0 - gap) for gap in gaps_deg]
    assume(all(abs(bend - 35.0) > 0.5 for bend in straight))
    assume(all(abs(gap - 45.0) > 0.5 for gap in gaps_deg))
    kind, arms = _kind(gaps_deg, 0.0)
    assert arms == len(gaps_deg)
    assert _kind(gaps_deg, turned_deg) == (kind, arms)
    assert _kind(gaps_deg, turned_deg, mirrored=True) == (kind, arms)
    if arms == 3:
        stem = any(
            bend <= 35.0 and min(g for j, g in enumerate(gaps_deg) if j != i) >= 45.0
            for i, bend in enumerate(straight)
        )
        assert kind == ("t_junction" if stem else "y_junction")
