"""Learns from recorded drives how far a car gets, and says how well that holds on others."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from foretwin.contracts.errors import UserError
from foretwin.contracts.terminal import say
from foretwin.orchestrator.commands.output import print_table
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.forecast.examples import Examples, causal_states, examples_of
from foretwin.orchestrator.forecast.learning import learn
from foretwin.orchestrator.forecast.progress_model import ProgressModel, progress_of
from foretwin.orchestrator.forecast.quantile_trees import write_trees
from foretwin.orchestrator.forecast.scoring import DriveScore, score
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.logs import open_log


def learn_progress(
    logs: Sequence[Path],
    *,
    out: Path | None,
    check: Sequence[Path],
    table: str | None,
    licence: str,
) -> CommandResult:
    """Write the table learnt from `logs` to `out`, and return how it does on those of `check`.

    Without logs to learn from, `table` is checked. Raises UserError for what cannot be used.
    """
    if twice := {path.resolve() for path in logs} & {path.resolve() for path in check}:
        raise UserError(f"--check {min(twice)}: a drive that is learnt from proves nothing")
    if logs and out is None:
        raise UserError("learning needs --out FILE, where the table goes")
    if not logs and not check:
        raise UserError("nothing to do: name drives to learn from, or with --check some to check")
    if out is not None and not logs:
        raise UserError(f"--out {out}: nothing is learnt without drives to learn from")
    if table is not None and logs:
        raise UserError(f"--table {table}: goes with --check alone, where nothing is learnt")
    if logs and out is not None:
        drives = {name: _examples(path) for name, path in _named(logs).items()}
        learnt = learn(drives, words={"licence": licence})
        write_trees(learnt, out)
        model: ProgressModel | None = ProgressModel(learnt)
        told = f"{out}: {len(learnt.value)} nodes, learnt from {learnt.words['drives']}"
    else:
        model = progress_of(table)
        told = ""
    if model is None:
        raise UserError("--table off: nothing to check")
    scores = {name: score(model, _examples(path)) for name, path in _named(check).items()}
    return CommandResult(
        {name: _figures(of) for name, of in scores.items()}, lambda: _say(told, scores)
    )


def _named(paths: Sequence[Path]) -> dict[str, Path]:
    """Return drives by what tells their names apart, the stem where it does; each counts once."""
    whole = {path.resolve(): path for path in paths}
    called = {one: (one.stem, *_endings(one)) for one in whole}
    often = Counter(name for names in called.values() for name in set(names))
    return {
        next(name for name in names if often[name] == 1): whole[one]
        for one, names in called.items()
    }


def _endings(path: Path) -> list[str]:
    """Return the file's name, that with its folder, and so on up to the root."""
    return ["/".join(path.parts[-count:]) for count in range(1, len(path.parts) + 1)]


def _say(told: str, scores: dict[str, DriveScore]) -> None:
    if told:
        say(told)
    if scores:
        _print(scores)


def _examples(path: Path) -> Examples:
    found = examples_of(causal_states(open_log(path), load_vehicle()))
    if not len(found.stamp_ns):
        raise UserError(f"{path}: no 10 s of a drive in it")
    return found


def _figures(of: DriveScore) -> dict[str, float | int]:
    return {
        "count": int(of.share.size),
        "p10_p90_coverage": round(of.coverage, 4),
        "p10_p90_coverage_table": round(of.table_coverage, 4),
        "p10_p90_width_m": _mean(of.width_m),
        "p10_p90_width_table_m": _mean(of.table_width_m),
        "crps": _mean(of.crps_m),
        "crps_table": _mean(of.table_crps_m),
        "median_error_m": _mean(of.median_off_m),
        "constant_speed_error_m": _mean(of.constant_speed_off_m),
        "constant_accel_error_m": _mean(of.constant_accel_off_m),
    }


def _mean(values: object) -> float:
    found = np.asarray(values)
    return round(float(found.mean()), 4) if found.size else float("nan")


def _print(scores: dict[str, DriveScore]) -> None:
    """Print a line for each drive: calibrated while driving, and in brackets the table alone."""
    columns = ("drive", "rounds", "p10 to p90 holds", "width", "CRPS", "median off", "steady off")
    rows = []
    for name, of in scores.items():
        told = _figures(of)
        rows.append(
            (
                name,
                len(of.share),
                f"{of.coverage:.1%} ({of.table_coverage:.1%})",
                f"{told['p10_p90_width_m']:.2f} ({told['p10_p90_width_table_m']:.2f}) m",
                f"{told['crps']:.2f} ({told['crps_table']:.2f}) m",
                f"{told['median_error_m']:.2f} m",
                f"{told['constant_accel_error_m']:.2f} m",
            )
        )
    print_table("Forecasts of 1 to 8 s, calibrated while driving (table alone)", columns, rows)
