"""The example of docs/learning.md: a minute of search beats its start on cases it never saw."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[3] / "examples" / "cross_entropy.py"


@pytest.mark.judge
@pytest.mark.timeout(1200)
def test_the_cross_entropy_method_beats_its_start_on_a_roundabout_entry() -> None:
    spec = importlib.util.spec_from_file_location("cross_entropy", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)

    found = example.search(example.town_roundabout())

    print(found)
    # Who keeps the speed whatever happens runs into the circulating car.
    assert found.before.collided > 0.5
    assert found.after.mean_return > found.before.mean_return + 2.0
    assert found.after.collided < 0.5 * found.before.collided
    assert found.after.arrived > found.before.arrived + 0.2
