"""What stands beside a road hides who stands behind it, or does not."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.beside_road import Obstacle, ObstacleKind
from foretwin.contracts.provenance import Quantity


@pytest.mark.parametrize(
    ("kind", "height_m", "opaque"),
    [
        ("hedge", 1.39, False),
        ("hedge", 1.4, True),
        ("wall", 4.0, True),
        ("fence", 4.0, False),
        ("tree", 9.0, False),
    ],
)
def test_what_is_high_and_close_hides_who_stands_behind_it(
    kind: ObstacleKind, height_m: float, opaque: bool
) -> None:
    height = Quantity(height_m, "tagged")
    assert Obstacle(id="o", kind=kind, outline=np.zeros((3, 2)), height_m=height).opaque == opaque
