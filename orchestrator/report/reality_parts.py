"""Sections on how far simulation and reality part: prediction, gap, calibration, verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from foretwin.contracts.segments import DRIVE_FILE
from foretwin.contracts.terminal import command_line
from foretwin.orchestrator.report.blocks import (
    Block,
    Chapter,
    Listed,
    Plotted,
    Prose,
    TableCell,
    number,
    plural,
    row,
)
from foretwin.orchestrator.report.gap_rows import HumanRow, gaps_of
from foretwin.orchestrator.report.material import RunMaterial
from foretwin.orchestrator.report.plots import calibration_plot, gap_plot, rank_plot
from foretwin.sim_worker.analysis.agreement.tally import NOT_ASKED, OUTCOMES
from foretwin.sim_worker.analysis.gap.errors import GapRow
from foretwin.sim_worker.analysis.gap.monitor import LONG_EVERY, SHORT_S

_DEG = 57.29578
_WORDS = {
    "clearance": "clearance to others",
    "drivable_area": "on the road",
    "red_light": "red lights",
    "stop_line": "stop lines",
    "comfort": "comfort",
}

_RARER = (
    f"Runs of up to {SHORT_S:g} s were measured once a second, longer ones once in {LONG_EVERY} s. "
)
_NOT_ASKED = (
    "Not observable: between pass and fail, as near as map and positions are known. Not asked: the "
    "recording has not what it takes to ask, or nothing that the criterion is about is there; such "
    "criteria count for nothing in the first row, where not observable are also windows of which "
    "none is asked."
)
_ASKED_OR_NOT = (
    "Not observable: asked in vain, or not asked; the run's record does not tell these apart."
)


def prediction_part(run: RunMaterial) -> Chapter:
    """Return how far the nominal future lay from the drive, beside two baselines."""
    told = run.record.get("comparison") or {}
    errors = told.get("ade_m") or {}
    if not errors:
        text = "Nothing was foreseen and then driven long enough to be compared."
        return Chapter("prediction", "Foreseen and driven", (Prose(text),))
    rows = tuple(
        row(
            TableCell(f"{horizon} s", order=float(horizon)),
            *(
                number((told.get(name) or {}).get(horizon), 2, "m")
                for name in (
                    "ade_m",
                    "weighted_ade_m",
                    "constant_velocity_ade_m",
                    "constant_turn_rate_ade_m",
                )
            ),
            number(float((told.get("count") or {}).get(horizon, 0)), 0),
        )
        for horizon in errors
    )
    blocks: list[Block] = [
        Listed(
            "Mean distance between prediction and drive, up to each horizon",
            (
                "horizon",
                "nominal future",
                "all futures, weighed",
                "constant velocity",
                "constant turn rate",
                "rounds",
            ),
            rows,
            frozenset(range(6)),
        )
    ]
    if told.get("independent") is False:
        text = (
            "The car's commands were not recorded and are estimated from its motion: these are "
            "distances of a prediction, not a test of the vehicle model alone."
        )
        blocks.append(Prose(text, "quiet"))
    return Chapter("prediction", "Foreseen and driven", tuple(blocks))


def gap_part(run: RunMaterial, people: Sequence[HumanRow] = ()) -> Chapter:
    """Return the gap by horizon and manoeuvre; `people` is how far drivers differ, where known."""
    found = gaps_of(run.table("gaps"))
    title = "Gap of the model by horizon and manoeuvre"
    if not found:
        text = (
            "The gap was not measured while driving; "
            f"`{command_line('gap', f'{run.called}/{DRIVE_FILE}')}` measures it from the recording."
        )
        return Chapter("gap", title, (Prose(text), *_people(people)))
    blocks: list[Block] = [
        Listed(
            "Model minus reality after it was left to itself (RMS; 95 % of gaps are below)",
            (
                "horizon",
                "manoeuvre",
                "runs",
                "along",
                "across",
                "heading",
                "speed",
                "place",
                "place, 95 %",
            ),
            tuple(_gap_row(one) for one in found),
            frozenset({0, 2, 3, 4, 5, 6, 7, 8}),
            note=_RARER
            + (
                "The model was driven by commands that were recorded."
                if all(one.independent for one in found)
                else "Commands were not recorded and are estimated from the motion that the model "
                "is compared with: such gaps accuse nobody, and no limits hold for them."
            ),
        ),
        Plotted(
            gap_plot(found, people),
            "Gap of place (RMS) by how long the model ran freely; "
            "a manoeuvre is hidden by a click on its name.",
        ),
    ]
    return Chapter("gap", title, (*blocks, *_people(people)))


def _gap_row(one: GapRow) -> tuple[TableCell, ...]:
    return row(
        TableCell(f"{one.horizon_s:g} s", order=one.horizon_s),
        one.manoeuvre,
        number(float(one.runs), 0),
        number(one.rms["along_m"], 2, "m"),
        number(one.rms["across_m"], 2, "m"),
        number(one.rms["yaw_rad"] * _DEG, 1, "°"),
        number(one.rms["speed_mps"], 2, "m/s"),
        number(one.rms["position_m"], 2, "m"),
        number(one.p95["position_m"], 2, "m"),
    )


def _people(people: Sequence[HumanRow]) -> list[Block]:
    if not people:
        text = (
            "How far people differ on this road is not known here: `foretwin report … --against "
            "LOG` measures it with another drive of the same road, and puts it beside."
        )
        return [Prose(text, "quiet")]
    rows = tuple(
        row(
            TableCell(f"{one.horizon_s:g} s", order=one.horizon_s),
            number(float(one.places), 0),
            number(one.along_m, 2, "m"),
            number(one.across_m, 2, "m"),
            number(one.speed_mps, 2, "m/s"),
        )
        for one in people
    )
    return [
        Listed(
            "How far two drives of this road part where nothing is wrong (RMS)",
            ("after", "places", "along", "across", "speed"),
            rows,
            frozenset(range(5)),
            note="Seconds after a place that both passed at like speed, and from which neither can "
            "have left the road in common by then.",
        )
    ]


def agreement_part(run: RunMaterial) -> Chapter:
    """Return whether simulation and drive come to the same verdict on the same seconds."""
    told = run.record.get("agreement")
    title = "Simulation against reality: the same seconds judged"
    if not told:
        return Chapter("agreement", title, (Prose("No seconds were both simulated and driven."),))
    counts = {"all criteria": told["overall"], **told["by_criterion"]}
    rows = tuple(
        row(_WORDS.get(name, name), *(_outcome(count, key) for key in (*OUTCOMES, NOT_ASKED)))
        for name, count in counts.items()
    )
    parted = all(NOT_ASKED in count for count in told["by_criterion"].values())
    blocks: list[Block] = [
        Listed(
            f"Verdicts in {plural(told['windows'], 'window')} of some seconds",
            (
                "criterion",
                "agree: passed",
                "agree: failed",
                "too pessimistic",
                "too optimistic",
                "not observable",
                "not asked",
            ),
            rows,
            frozenset({1, 2, 3, 4, 5, 6}),
            note="Too optimistic: the simulation passes where the drive failed. "
            + (_NOT_ASKED if parted else _ASKED_OR_NOT),
        ),
        *(
            Prose(_flip(direction, flip))
            for direction, flip in told["flips"].items()
            if flip["flipped"]
        ),
    ]
    return Chapter("agreement", title, tuple(blocks))


def _outcome(count: dict[str, int], key: str) -> TableCell:
    wrong = key in ("too_pessimistic", "too_optimistic") and count[key]
    found = count.get(key)
    return number(None if found is None else float(found), 0, tone="bad" if wrong else "")


def _flip(direction: str, flip: dict[str, Any]) -> str:
    where = "along and across" if direction == "both" else direction
    fails = " and ".join(flip["smallest_factor_fails"]) or "nothing"
    return (
        f"A gap {where} would turn the verdict of {plural(flip['flipped'], 'window')}; the nearest "
        f"to it at {flip['smallest_factor_at_s']:.1f} s, with {flip['smallest_factor']:g} times "
        f"the measured gap ({flip['smallest_factor_gap_m']:.2f} m), {fails} failing then."
    )


def calibration_part(run: RunMaterial) -> Chapter:
    """Return how the likelihoods of progress compare with what came."""
    told = run.record.get("calibration")
    title = "Calibration: likelihood against what came"
    if not told:
        return Chapter(
            "calibration", title, (Prose("No forecast of the car's progress came true."),)
        )
    rows = tuple(
        row(
            TableCell(f"{horizon} s", order=float(horizon)),
            number(100.0 * one["p10_p90_coverage"], 0, "%"),
            number(one["p10_p90_width_m"], 1, "m"),
            number(one["median_error_m"], 2, "m"),
            number(one["crps"], 2, "m"),
            number(one["crps_uncalibrated"], 2, "m"),
            number(float(one["count"]), 0),
        )
        for horizon, one in told.get("by_horizon_s", {}).items()
    )
    count, covered = plural(told["count"], "instant"), told["p10_p90_coverage"]
    text = (
        f"Of {count} that came, {covered:.0%} lay in the band that should hold 80 %. The mean "
        f"score (CRPS, small is good) is {told['crps']:.2f} m"
    )
    alike_m = told["crps_uncalibrated"]
    text += "." if alike_m is None else f", and {alike_m:.2f} m where all futures count alike."
    return Chapter(
        "calibration",
        title,
        (
            Prose(text),
            Plotted(
                rank_plot(told["rank_histogram"]),
                "In which tenth of their forecasts what "
                "came fell: level where forecasts are calibrated.",
            ),
            Plotted(
                calibration_plot(told.get("by_horizon_s", {})),
                "Share of what came that lay from p10 to p90 of its forecast; 80 % is right.",
            ),
            Listed(
                "By how far ahead",
                (
                    "ahead",
                    "within p10 to p90",
                    "band",
                    "median off",
                    "CRPS",
                    "CRPS, futures alike",
                    "instants",
                ),
                rows,
                frozenset(range(7)),
            ),
        ),
    )
