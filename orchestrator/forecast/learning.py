"""Learns a table of progress from examples of drives; needs scikit-learn, the extra `learn`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError
from foretwin.contracts.forecast import PROGRESS_TIMES_S, rising
from foretwin.orchestrator.forecast.examples import Examples
from foretwin.orchestrator.forecast.features import FEATURES
from foretwin.orchestrator.forecast.progress_model import distance_m
from foretwin.orchestrator.forecast.quantile_trees import LEAF_UNIT_MPS2, QuantileTrees
from foretwin.sim_worker.driver_model import STANDING_MPS

LEVELS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95)
ROUNDS = 60
LEAVES = 12
LEAST_IN_LEAF = 80
"""Rows, of which each instant gives 16: one for each of 8 instants, with and without the way."""
LEARNING_RATE = 0.08
FOLDS = 5
LEAST_EXAMPLES = 400
"""Of half a second each: from less than some minutes nothing is learnt but those minutes."""


class ExampleRows(NamedTuple):
    """Rows of features (N, F), what came of them (N,) as `distance_m` has it, and of which block of
    drives (N,)."""

    features: Array
    accel_mps2: Array
    block: Array


def rows_of(drives: Sequence[Examples]) -> ExampleRows:
    """Return each example once for each instant, with the way ahead and without."""
    times_s = np.array(PROGRESS_TIMES_S)
    features, accel, block = [], [], []
    for number, drive in enumerate(drives):
        for told in (drive.features, drive.blind):
            rows = np.repeat(told, len(times_s), axis=0)
            rows[:, FEATURES.index("time_s")] = np.tile(times_s, len(told))
            came = drive.distance_m - drive.speed_mps[:, None] * times_s
            features.append(rows)
            accel.append((2.0 * came / times_s**2).ravel())
            block.append(np.full(len(rows), number))
    return ExampleRows(np.concatenate(features), np.concatenate(accel), np.concatenate(block))


def learn(
    drives: Mapping[str, Examples], *, words: Mapping[str, str] | None = None
) -> QuantileTrees:
    """Return the table learnt from drives by their names.

    Raises UserError without scikit-learn, or where the drives are too short.
    """
    count = sum(len(drive.stamp_ns) for drive in drives.values())
    if count < LEAST_EXAMPLES:
        raise UserError(
            f"{count * 0.5:.0f} s of drives: {LEAST_EXAMPLES * 0.5:.0f} s at least are needed"
        )
    blocks = _blocks(list(drives.values()))
    rows = rows_of(blocks)
    told = np.asarray(np.isfinite(rows.features).any(axis=0))
    known = [name for name, has in zip(FEATURES, told.tolist(), strict=True) if has]
    rows = rows._replace(features=rows.features[:, told])
    shares = _shares_elsewhere(blocks, rows)
    return _as_table(
        [_boosted(rows, level) for level in LEVELS],
        features=tuple(known),
        shares=shares,
        words={"drives": ", ".join(sorted(drives)), **(words or {})},
    )


def _blocks(drives: Sequence[Examples]) -> list[Examples]:
    """Return drives as at least `FOLDS` blocks: one that is longer than a fold's share is cut.

    Neighbouring blocks of a drive know the same driver, but not the same road.
    """
    total = sum(len(drive.stamp_ns) for drive in drives)
    found = []
    for drive in drives:
        pieces = max(1, round(len(drive.stamp_ns) * FOLDS / total))
        found += [
            Examples(*(column[places] for column in drive))
            for places in np.array_split(np.arange(len(drive.stamp_ns)), pieces)
        ]
    return found


def _shares_elsewhere(blocks: Sequence[Examples], rows: ExampleRows) -> Array:
    """Return (T, L) which share of what came lay below each level, of moving cars, where it was
    learnt from the other blocks."""
    times_s = np.array(PROGRESS_TIMES_S)
    fold_of = np.arange(len(blocks)) % min(FOLDS, len(blocks))
    below: list[Array] = []
    for fold in range(int(fold_of.max()) + 1):
        inside = fold_of[rows.block] == fold
        others = ExampleRows(*(column[~inside] for column in rows))
        models = [_boosted(others, level) for level in LEVELS]
        for number in np.flatnonzero(fold_of == fold).tolist():
            drive = blocks[number]
            mine = rows.features[rows.block == number][: len(drive.stamp_ns) * len(times_s)]
            accel = np.column_stack([model.predict(mine) for model in models])
            shape = (len(drive.stamp_ns), len(times_s), len(LEVELS))
            for place in np.flatnonzero(drive.speed_mps >= STANDING_MPS):
                guess = rising(
                    distance_m(accel.reshape(shape)[place], drive.speed_mps[place], times_s)
                )
                below.append(drive.distance_m[place][:, None] <= guess)
    held = np.mean(below, axis=0)
    # Of few blocks a share may stand still: levels have to rise.
    mixed = 0.98 * held + 0.02 * np.array(LEVELS)
    return np.clip(np.maximum.accumulate(mixed, axis=1), 0.004, 0.996)


def _boosted(rows: ExampleRows, level: float) -> Any:
    try:
        from sklearn.ensemble import HistGradientBoostingRegressor
    except ImportError as error:
        raise UserError(
            "learning needs scikit-learn, which is not installed: pip install 'foretwin[learn]'"
        ) from error
    model = HistGradientBoostingRegressor(
        loss="quantile",
        quantile=level,
        max_iter=ROUNDS,
        max_leaf_nodes=LEAVES,
        min_samples_leaf=LEAST_IN_LEAF,
        learning_rate=LEARNING_RATE,
        early_stopping=False,
        random_state=0,
    )
    return model.fit(rows.features, rows.accel_mps2)


def _as_table(
    models: Sequence[Any], *, features: tuple[str, ...], shares: Array, words: dict[str, str]
) -> QuantileTrees:
    """Return models as one table; a leaf leads to itself."""
    columns: dict[str, list[Any]] = {name: [] for name in _NODE}
    roots, trees, base, count = [], [0], [], 0
    for model in models:
        for (predictor,) in model._predictors:
            nodes, here = predictor.nodes, np.arange(len(predictor.nodes)) + count
            leaf = nodes["is_leaf"].astype(bool)
            columns["feature"].append(np.where(leaf, 0, nodes["feature_idx"]))
            columns["threshold"].append(np.where(leaf, 0.0, nodes["num_threshold"]))
            columns["left"].append(np.where(leaf, here, nodes["left"] + count))
            columns["right"].append(np.where(leaf, here, nodes["right"] + count))
            columns["missing_left"].append(nodes["missing_go_to_left"].astype(bool) & ~leaf)
            columns["value"].append(np.where(leaf, np.round(nodes["value"] / LEAF_UNIT_MPS2), 0.0))
            roots.append(count)
            count += len(nodes)
        trees.append(len(roots))
        base.append(round(float(model._baseline_prediction.item()) / LEAF_UNIT_MPS2))
    joined = {name: np.concatenate(parts) for name, parts in columns.items()}
    whole = {name: joined[name].astype(np.int64) for name in ("feature", "left", "right", "value")}
    return QuantileTrees(
        features=features,
        levels=np.array(LEVELS),
        time_s=np.array(PROGRESS_TIMES_S),
        threshold=joined["threshold"],
        missing_left=joined["missing_left"],
        roots=np.array(roots, dtype=np.int64),
        trees=np.array(trees, dtype=np.int64),
        base=np.array(base, dtype=np.int64),
        shares=shares,
        words=words,
        **whole,
    )


_NODE = ("feature", "threshold", "left", "right", "missing_left", "value")
