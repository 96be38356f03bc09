"""Compute pose errors of drawn trajectories with evo, and keep both as JSON.

Run once, in an environment of its own; evo is GPL-3 and nothing else here needs it:

    python -m venv VENV && VENV/bin/pip install evo==1.38.1
    VENV/bin/python tests/sim_worker/metrics/freeze_evo.py tests/data/metrics/evo.json
"""

from __future__ import annotations

import importlib.metadata
import json
import sys
from pathlib import Path

import numpy as np
from evo.core import metrics
from evo.core.trajectory import PoseTrajectory3D

INSTANTS, STEP_S = 40, 0.1


def main(out: Path) -> None:
    random = np.random.default_rng(7)
    pairs = []
    for _ in range(6):
        reference = drive(random)
        estimate = reference + np.cumsum(random.normal(0.0, 0.05, reference.shape), axis=0)
        both = (trajectory(reference), trajectory(estimate))
        row = {"reference": reference.tolist(), "estimate": estimate.tolist()}
        for name, metric in (
            ("ape_rmse_m", metrics.APE(metrics.PoseRelation.translation_part)),
            (
                "rpe_rmse_m",
                metrics.RPE(metrics.PoseRelation.translation_part, 1, metrics.Unit.frames),
            ),
        ):
            metric.process_data(both)
            row[name] = float(metric.get_statistic(metrics.StatisticsType.rmse))
        pairs.append(row)
    kept = {"evo": importlib.metadata.version("evo"), "step_s": STEP_S, "pairs": pairs}
    out.write_text(json.dumps(kept) + "\n", encoding="utf-8")


def drive(random: np.random.Generator) -> np.ndarray:
    """(N, 3) poses that keep changing speed and yaw rate."""
    speed = 8.0 + np.cumsum(random.normal(0.0, 0.3, INSTANTS))
    yaw = np.cumsum(random.normal(0.02, 0.05, INSTANTS))
    step = STEP_S * speed[:, None] * np.column_stack([np.cos(yaw), np.sin(yaw)])
    return np.column_stack([np.cumsum(step, axis=0), yaw])


def trajectory(poses: np.ndarray) -> PoseTrajectory3D:
    half = poses[:, 2] / 2.0
    none = np.zeros(len(poses))
    return PoseTrajectory3D(
        positions_xyz=np.column_stack([poses[:, :2], none]),
        orientations_quat_wxyz=np.column_stack([np.cos(half), none, none, np.sin(half)]),
        timestamps=np.arange(len(poses)) * STEP_S,
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
