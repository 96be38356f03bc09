"""Whether a car was driven gently, as far as estimates of its speed and heading can tell."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.analysis.agreement.judgement import Judgement
from foretwin.sim_worker.metrics.comfort import BOUNDS, motion, motion_std, scatter
from foretwin.sim_worker.metrics.rollout import RolloutView

MOST_COVERAGE = 3.0
"""Standard deviations of the greatest among a window's hundred instants: its mean is 2.5."""
SELDOM_S = 0.4
"""States rarer than this say nothing of derivatives over 0.8 s."""
_ALIKE_S = 0.2
"""So long errors of an estimate stay alike: the time that blurs derivatives over 0.8 s the most."""
_LEAST_SEEN = 0.5
"""Share of the instants at which an excess as large as the bound must show for a pass."""
_MOST_GRIP_MPS2 = 11.8
"""1.2 g, more than tyres hold on a dry road: who seems to do more is not known well enough."""


def gently(view: RolloutView, std: Array | None = None) -> Judgement:
    """Judge (S,) by `comfort.BOUNDS` motion that is known exactly, or by `std` (N, 2) of speed and
    yaw: what lies beyond them by more than its own uncertainty fails."""
    found = view.keep(motion)._asdict()
    passes, fails = (np.full(len(view.valid), value) for value in (True, False))
    if std is None:
        for name, (least, most) in BOUNDS.items():
            passes &= ((found[name] >= least) & (found[name] <= most)).all(axis=1)
        return Judgement(passes, ~passes)
    if not np.isfinite(std).all():
        return Judgement(~passes, fails)
    # A source that jumps says by its scatter what it does not say of itself.
    seen_std = [np.maximum(std[:, k], one) for k, one in enumerate(scatter(view))]
    doubt = motion_std(view, *seen_std, alike_s=_ALIKE_S)._asdict()
    for name, (least, most) in BOUNDS.items():
        either = MOST_COVERAGE * doubt[name]
        passes &= ((found[name] >= least) & (found[name] <= most)).all(axis=1)
        # At a window's ends derivatives say little.
        passes &= (either <= most).mean(axis=1) >= _LEAST_SEEN
        fails |= ((found[name] + either < least) | (found[name] - either > most)).any(axis=1)
    for name in ("lon_accel_mps2", "lat_accel_mps2"):
        beyond = np.abs(found[name]) - MOST_COVERAGE * doubt[name] > _MOST_GRIP_MPS2
        fails &= ~beyond.any(axis=1)
    return Judgement(passes, fails)
