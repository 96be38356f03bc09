"""A plan and a drive are compared by the ways that they led, not by how they stood."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.sim_worker.analysis.side_by_side.departure import departure


def test_who_trembles_on_the_spot_has_driven_no_farther() -> None:
    """A stop whose positions jump to and fro by 15 cm: a plan beyond it is not compared."""
    x_m = np.append(np.arange(0.0, 8.0, 0.5), 7.5 - 0.15 * (np.arange(24) % 2))
    still = np.zeros_like(x_m)
    driven = np.column_stack([x_m, still, still, still])
    ahead_m = np.linspace(0.0, 12.0, len(x_m))
    turned = np.maximum(ahead_m - 8.0, 0.0)
    planned = np.column_stack([ahead_m, turned, still, still])
    assert departure(planned, driven).lateral_m == pytest.approx(0.0, abs=0.01)
