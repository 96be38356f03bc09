"""A table is learnt from drives, written, read and evaluated by numpy alone."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.errors import UserError
from foretwin.contracts.forecast import PROGRESS_LEVELS
from foretwin.orchestrator.forecast import learning
from foretwin.orchestrator.forecast.features import FEATURES
from foretwin.orchestrator.forecast.learning import _boosted, learn, rows_of
from foretwin.orchestrator.forecast.progress_model import (
    ProgressModel,
    distance_m,
    progress_model,
    progress_of,
)
from foretwin.orchestrator.forecast.quantile_trees import QuantileTrees, read_trees, write_trees
from foretwin.orchestrator.forecast.scoring import score
from tests.orchestrator.forecast.town_drives import town_examples, town_states

COVERS = (
    "foretwin.orchestrator.forecast.examples",
    "foretwin.orchestrator.forecast.progress_model",
    "foretwin.orchestrator.forecast.quantile_trees",
    "foretwin.orchestrator.forecast.scoring",
)
pytest.importorskip("sklearn", reason="the extra `learn` is not installed")


@pytest.fixture(autouse=True, scope="module")
def few_rounds() -> Iterator[None]:
    """What is said of a table here is true of one of a third as many trees, which takes seconds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(learning, "ROUNDS", 20)
        yield


@cache
def learnt() -> QuantileTrees:
    return learn({"one": town_examples(seed=1, minutes=6.0)}, words={"licence": "ours"})


def test_a_drive_gives_what_was_known_and_how_far_it_went() -> None:
    drive = town_examples(seed=2, minutes=2.0)
    way = np.diff(drive.distance_m, axis=1)
    bend = FEATURES.index("bend_100m_mps")

    assert len(drive.stamp_ns) > 180
    assert (way >= 0.0).all()
    # What came in the first second is about the speed.
    assert np.abs(drive.distance_m[:, 0] - drive.speed_mps).max() < 2.0
    assert np.isnan(drive.blind[:, bend]).all()
    assert drive.features[:, bend].min() < 20.0


def test_what_is_known_of_an_instant_hangs_on_nothing_after_it() -> None:
    whole = town_examples(seed=2, minutes=2.0)
    states = [s for s in town_states(seed=2, minutes=2.0) if s.stamp_ns <= 60_000_000_000]
    from foretwin.orchestrator.forecast.examples import examples_of

    cut = examples_of(states)
    assert np.array_equal(cut.blind, whole.blind[: len(cut.blind)], equal_nan=True)


def test_the_table_says_what_the_trees_say() -> None:
    rows = rows_of([town_examples(seed=1, minutes=6.0)])
    told = np.isfinite(rows.features).any(axis=0)
    table = learnt()
    some = rows.features[::97]
    levels = learning.LEVELS
    for k in (0, len(levels) // 2, len(levels) - 1):
        fitted = _boosted(rows._replace(features=rows.features[:, told]), levels[k])
        values = table.values(some[:, told], table.depth)[:, k]
        assert values == pytest.approx(fitted.predict(some[:, told]), abs=1e-4)


def test_a_table_is_the_same_bytes_each_time_and_reads_as_it_was_written(tmp_path: Path) -> None:
    for name in ("a.npz", "b.npz"):
        write_trees(learnt(), tmp_path / name)
    read = read_trees(tmp_path / "a.npz")

    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    assert read.words == {"drives": "one", "licence": "ours"}
    assert read.features == learnt().features
    drive = town_examples(seed=3, minutes=2.0)
    one, other = ProgressModel(learnt()), ProgressModel(read)
    for row in drive.features[:5]:
        assert one.forecast(row).distance_m.tobytes() == other.forecast(row).distance_m.tobytes()


def test_on_a_drive_that_was_not_learnt_from_the_band_holds_its_share() -> None:
    """The driver is hastier than the one learnt from; calibration makes up for it."""
    drive = town_examples(seed=11, minutes=10.0, haste=1.6)
    found = score(ProgressModel(learnt()), drive)

    assert found.coverage == pytest.approx(0.8, abs=0.07)
    assert abs(found.coverage - 0.8) < abs(found.table_coverage - 0.8)
    assert found.median_off_m.mean() < 0.8 * found.constant_accel_off_m.mean()


def test_a_forecast_rises_and_never_goes_back() -> None:
    model = progress_model()
    drive = town_examples(seed=3, minutes=2.0)
    for row in [*drive.features[::20], np.full(len(FEATURES), np.nan)]:
        row = np.where(np.arange(len(row)) == FEATURES.index("speed_mps"), 5.0, row)
        forecast = model.forecast(row)
        assert forecast.levels == pytest.approx(PROGRESS_LEVELS)
        assert (np.diff(forecast.distance_m, axis=1) > 0.0).all()
        assert (np.diff(forecast.median_m) >= -1e-9).all()
        assert forecast.distance_m.min() >= 0.0


def test_a_standing_car_is_expected_to_stand_and_a_fast_one_to_go_on() -> None:
    row = np.full(len(FEATURES), np.nan)
    place = {name: k for k, name in enumerate(FEATURES)}
    row[[place["speed_mps"], place["accel_mps2"], place["since_standing_s"]]] = 0.0
    standing = progress_model().forecast(row)
    row[[place["speed_mps"], place["since_standing_s"]]] = 13.0, 30.0
    row[place["speed_most_30s_mps"]] = 13.5
    going = progress_model().forecast(row)

    assert standing.at(0.5)[0] < 0.5
    assert going.at(0.5)[0] == pytest.approx(13.0, abs=1.0)


def test_mean_accelerations_and_distances() -> None:
    found = distance_m(np.array([[0.0, 2.0, -50.0]]), 10.0, np.array([4.0]))

    assert found.tolist() == [[40.0, 56.0, 0.0]]


def test_too_little_is_refused_and_off_is_nothing() -> None:
    with pytest.raises(UserError, match="200 s at least"):
        learn({"short": town_examples(seed=2, minutes=2.0)})
    assert progress_of("off") is None


@pytest.mark.parametrize(
    ("field", "value", "why"),
    [
        ("left", lambda t: np.zeros_like(t.left), "leads back"),
        ("feature", lambda t: t.feature + 99, "feature"),
        ("levels", lambda t: t.levels[::-1], "must rise"),
        ("trees", lambda t: t.trees + 1, "trees"),
        ("shares", lambda t: t.shares[:, 1:], "shares"),
        ("time_s", lambda t: -t.time_s, "time_s"),
    ],
)
def test_a_table_that_could_not_be_used_is_refused(tmp_path: Path, field, value, why) -> None:
    spoilt = learnt()._replace(**{field: value(learnt())})
    write_trees(spoilt, tmp_path / "spoilt.npz")

    with pytest.raises(UserError, match=f"spoilt.npz: no table of progress: .*{why}"):
        read_trees(tmp_path / "spoilt.npz")


@pytest.mark.parametrize("data", [b"", b"PK\x03\x04 nothing", b"text"])
def test_another_file_is_no_table(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "other.npz").write_bytes(data)
    with pytest.raises(UserError, match=r"other.npz: no table"):
        read_trees(tmp_path / "other.npz")


def test_a_table_of_unknown_features_is_refused() -> None:
    with pytest.raises(UserError, match="does not know"):
        ProgressModel(learnt()._replace(features=("moon", *learnt().features[1:])))


def test_a_forecast_needs_no_scikit_learn_and_takes_a_millisecond_or_two() -> None:
    model, row = progress_model(), town_examples(seed=3, minutes=2.0).features[40]
    begun = time.process_time()
    for _ in range(50):
        model.forecast(row)
    assert (time.process_time() - begun) / 50 < 0.01
    code = (
        "import sys; from foretwin.orchestrator.forecast.progress_model import progress_model; "
        "progress_model(); assert 'sklearn' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
