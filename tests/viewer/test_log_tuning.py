"""Findings of the vehicle as rows: gaps by manoeuvre, verdicts in words, parameters as curves."""

from __future__ import annotations

import msgspec

from foretwin.contracts.gap import Evidence, GapSample, Verdict
from foretwin.contracts.tuning import Identification, ParameterChange, ParameterEstimate
from tests.viewer import scene
from tests.viewer.shown import Shown, monitor_of, text_of


def test_findings_are_drawn_by_manoeuvre_and_told_in_words() -> None:
    monitor = monitor_of()
    stamp_ns = scene.START_NS + 5_000_000_000
    sample = GapSample(
        vehicle_id="ego",
        stamp_ns=stamp_ns,
        horizon_s=2.0,
        manoeuvre="curve",
        along_m=0.1,
        across_m=-0.4,
        yaw_rad=0.1,
        yaw_rate_radps=0.0,
        speed_mps=0.0,
        accel_mps2=0.0,
        independent=True,
    )
    shown = Shown(monitor.handle("gap", sample))
    assert shown.paths == [
        f"reality/{name}/{drawn}"
        for name in ("across_m", "along_m", "yaw_deg")
        for drawn in ("curve", "limit")
    ]
    assert shown["reality/across_m/curve"].scalars.as_arrow_array().to_pylist() == [-0.4]
    assert not monitor.handle("gap", msgspec.structs.replace(sample, horizon_s=8.0))

    verdict = Verdict(
        vehicle_id="ego",
        stamp_ns=stamp_ns,
        since_stamp_ns=stamp_ns,
        culprit="vehicle",
        cause="steering_gain",
        text="turns too little",
        confidence=0.9,
        evidence=(Evidence(name="gain", value=0.7, expected=1.0, std=0.02, text="by the tyre"),),
    )
    monitor.handle("verdict", msgspec.structs.replace(verdict, cause="brake_gain"))
    text = text_of(Shown(monitor.handle("verdict", verdict))["reality/verdict"])
    assert text.index("steering_gain") < text.index("brake_gain"), "the newest first"
    assert "gain: 0.7 ± 0.02, expected 1" in text


def test_parameters_have_curves_with_intervals_and_a_table() -> None:
    monitor = monitor_of()
    stamp_ns = scene.START_NS + 5_000_000_000
    told = Identification(
        vehicle_id="ego",
        from_stamp_ns=0,
        stamp_ns=stamp_ns,
        estimates=(
            ParameterEstimate(name="steering_ratio", value=15.3, low=15.1, high=15.5, prior=16.0),
            ParameterEstimate(
                name="brake_gain", value=None, low=None, high=None, prior=1.0, reason="no | grade"
            ),
        ),
    )
    shown = Shown(monitor.handle("identification", told))
    for curve, value in (("in_use", 16.0), ("value", 15.3), ("low", 15.1), ("high", 15.5)):
        scalars = shown[f"parameters/steering_ratio/{curve}"].scalars
        assert scalars.as_arrow_array().to_pylist() == [value]
    assert "parameters/brake_gain/value" not in shown.paths
    table = text_of(shown["parameters/table"])
    assert "| steering_ratio | 16 | 15.3 | 15.1 to 15.5 |  |" in table
    assert "| brake_gain | 1 | - |  | no \\| grade |" in table

    change = ParameterChange(
        vehicle_id="ego",
        stamp_ns=stamp_ns,
        name="steering_ratio",
        before=16.0,
        value=15.3,
        std=0.1,
        origin="identified",
    )
    rows = monitor.handle("parameter", change)
    assert [row.drive_ns for row in rows] == [4_999_999_999, 5_000_000_000, 5_000_000_000]
