"""Messages become rows: places, times, and what is refused."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.codec import SchemaMismatch
from foretwin.contracts.siblings import SiblingFuture
from foretwin.contracts.side_by_side import Disagreement
from foretwin.contracts.simulation import (
    AMBER_FROM,
    GREEN_TO,
    RED_FROM,
    ActiveWorld,
    Event,
    WorldNotice,
)
from foretwin.contracts.world import World
from foretwin.viewer.live_viewer import NoViewerError, live_viewer
from foretwin.viewer.log_scenarios import (
    CRITICAL,
    SAFE,
    WATCH,
    criticality_colours,
    rows_of_round,
    scenario_table,
)
from foretwin.viewer.monitor import Monitor, read_world
from tests.viewer import scene
from tests.viewer.copilot.rounds import line, round_of
from tests.viewer.shown import Shown, monitor_of, text_of

COVERS = (
    "foretwin.viewer.log_drive",
    "foretwin.viewer.log_run",
)


def _translation(transform: Any) -> np.ndarray:
    return np.array(transform.translation.as_arrow_array().to_pylist()[0])


def test_the_car_stands_where_the_mirror_says_it_is() -> None:
    monitor = monitor_of()
    shown = Shown(monitor.handle("state", scene.state_at(7.0)))
    real = scene.mirror_at(7.0).real
    np.testing.assert_allclose(
        _translation(shown["world/ego/real"]), [real.x_m, real.y_m, 0.0], atol=1e-3
    )
    quaternion = shown["world/ego/real"].quaternion.as_arrow_array().to_pylist()[0]
    assert 2.0 * np.arctan2(quaternion[2], quaternion[3]) == pytest.approx(real.yaw_rad, abs=1e-6)
    assert all(row.drive_ns == 7_000_000_000 for row in shown.rows)


def test_states_at_50_hz_are_shown_at_10_hz() -> None:
    monitor = monitor_of()
    shown = [monitor.handle("state", scene.state_at(tick / 50.0)) for tick in range(100)]
    assert sum(bool(rows) for rows in shown) == 20


def test_an_unknown_heading_keeps_the_last() -> None:
    monitor = monitor_of()
    monitor.handle("state", scene.state_at(1.0))
    lost = msgspec.structs.replace(scene.state_at(2.0), yaw_rad=2.0, yaw_valid=False)
    shown = Shown(monitor.handle("state", lost))
    quaternion = shown["world/ego/real"].quaternion.as_arrow_array().to_pylist()[0]
    assert abs(quaternion[2]) < 0.01


def test_the_eye_leans_from_the_car_towards_the_active_junction() -> None:
    monitor = monitor_of()
    active = ActiveWorld(stamp_ns=scene.START_NS, world_id=scene.WORLD_ID)
    monitor.handle("active_world", active)
    shown = Shown(monitor.handle("state", scene.state_at(0.0)))
    car, focus = _translation(shown["world/ego/real"]), _translation(shown["world/focus"])
    assert np.hypot(*(focus - car)[:2]) == pytest.approx(32.0, abs=0.01)
    for tick in range(1, 200):
        shown.rows += monitor.handle("state", scene.state_at(tick / 10.0))
    jumps = [_translation(row.components)[:2] for row in shown.rows if row.path == "world/focus"]
    assert np.hypot(*np.diff(jumps, axis=0).T).max() < 1.5


def test_open_ground_takes_the_futures_away() -> None:
    rows = monitor_of().handle("active_world", ActiveWorld(stamp_ns=scene.START_NS, world_id=None))
    assert [row.path for row in rows] == ["world/futures"]
    assert rows[0].components.is_recursive.as_arrow_array().to_pylist() == [True]  # type: ignore[attr-defined]


def test_a_world_is_read_once() -> None:
    read: list[str] = []

    def load(world_id: str) -> World:
        read.append(world_id)
        return scene.junction()

    monitor = monitor_of(load)
    notice = WorldNotice(world_id=scene.WORLD_ID, intersection_id="x1", file="f")
    assert len(monitor.handle("world", notice)) > 5
    assert monitor.handle("world", notice) == []
    monitor.handle("active_world", ActiveWorld(stamp_ns=0, world_id=scene.WORLD_ID))
    assert read == [scene.WORLD_ID]


def test_a_message_that_cannot_be_shown_is_told_as_an_event() -> None:
    broken = msgspec.structs.replace(scene.round_at(1.0), xy_m=np.zeros(3, dtype=np.float32))
    shown = Shown(monitor_of().handle("round", broken))
    assert shown.paths == ["events"]
    assert "round at 1.00 s" in str(shown["events"].text.as_arrow_array())


def test_futures_are_one_entity_with_the_nominal_thickest() -> None:
    shown = Shown(monitor_of().handle("round", scene.round_at(3.0)))
    futures = shown["world/futures"]
    assert len(futures.strips.as_arrow_array()) == 64
    radii = np.array(futures.radii.as_arrow_array().to_pylist())
    assert int(np.argmax(radii)) == scene.round_at(3.0).nominal_index


def test_a_late_round_takes_the_futures_away_and_shows_none_of_its_own() -> None:
    late = msgspec.structs.replace(scene.round_at(3.0), late=True, latency_ms=734.0)
    shown = Shown(monitor_of().handle("round", late))
    assert shown.paths == ["world/futures", "scenarios/table"]
    assert shown["world/futures"].is_recursive.as_arrow_array().to_pylist() == [True]
    assert "734 ms: too late" in text_of(shown["scenarios/table"])


def test_a_diverged_future_is_left_out() -> None:
    view = scene.round_at(3.0)
    xy_m = view.xy_m.copy()
    xy_m[5, 10:] = np.nan
    shown = Shown(monitor_of().handle("round", msgspec.structs.replace(view, xy_m=xy_m)))
    assert len(shown["world/futures"].strips.as_arrow_array()) == 63


def test_the_table_lists_the_worst_first() -> None:
    view = scene.round_at(3.0)
    rows = [line for line in scenario_table(view).splitlines() if line.startswith("| ")][1:]
    criticality = [float(row.split("|")[3]) for row in rows]
    assert criticality == sorted(criticality, reverse=True)
    assert criticality[0] == pytest.approx(float(view.criticality.max()), rel=0.1)
    assert {row.split("|")[4].strip() for row in rows} == {"grave"}


def test_colours_follow_the_order_of_magnitude() -> None:
    green, amber, red = criticality_colours(np.array([GREEN_TO, AMBER_FROM, RED_FROM])).tolist()
    assert (tuple(green), tuple(amber), tuple(red)) == (SAFE, WATCH, CRITICAL)


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=8))
def test_criticality_runs_from_green_to_red(values: list[float]) -> None:
    colours = criticality_colours(np.array([0.0, *values, 1.0]))
    assert tuple(colours[0]) == SAFE
    assert tuple(colours[-1]) == CRITICAL
    assert tuple(criticality_colours(np.array([np.nan]))[0]) == CRITICAL


def test_a_world_id_is_no_path(tmp_path: Any) -> None:
    with pytest.raises(FileNotFoundError, match="no name of a World"):
        read_world(tmp_path, "../secret")
    (tmp_path / "x.world").write_bytes(b"nonsense")
    with pytest.raises(SchemaMismatch, match=r"x\.world"):
        read_world(tmp_path, "x")


def test_an_unknown_live_view_names_the_choices() -> None:
    assert live_viewer("none") is None
    with pytest.raises(NoViewerError, match="native, web, none"):
        live_viewer("hologram")


def test_the_start_is_asked_for_when_the_vehicle_first_speaks() -> None:
    asked: list[int] = []

    def find_start(first_stamp_ns: int) -> int:
        asked.append(first_stamp_ns)
        return scene.START_NS

    monitor = Monitor(
        drive_frame=scene.DRIVE_FRAME,
        find_start=find_start,
        title="t",
        load_world=lambda _id: scene.junction(),
    )
    before = Event(stamp_ns=0, level="info", source="s", text="preparing")
    early = msgspec.structs.replace(before, stamp_ns=scene.START_NS - 5)
    assert monitor.handle("event", before)[0].drive_ns == 0
    assert asked == []
    assert monitor.handle("state", scene.state_at(3.0))[0].drive_ns == 3_000_000_000
    assert monitor.handle("event", early)[0].drive_ns == 0
    assert asked == [scene.START_NS + 3_000_000_000]


def test_where_human_and_ads_disagree_a_mark_stays() -> None:
    one = Disagreement(
        vehicle_id="ego",
        segment=0,
        aspect="pace",
        kind="ads_stops",
        stamp_ns=scene.START_NS + 2_000_000_000,
        end_stamp_ns=scene.START_NS + 3_000_000_000,
        over=False,
        position=scene.DRIVE_FRAME.origin,
        junction_id=None,
        route_m=None,
        lateral_m=0.0,
        along_m=-9.0,
        speed_mps=-6.0,
    )
    monitor = monitor_of()
    (row,) = monitor.handle("disagreement", one)
    assert row.path.startswith("world/disagreements/pace_")
    assert row.drive_ns == 2_000_000_000
    assert monitor.handle("disagreement", msgspec.structs.replace(one, over=True)) == []


def test_who_watches_sees_when_what_is_shown_was_sent() -> None:
    progress = next(m.message for m in scene.drive(duration_s=1.0) if m.channel == "progress")
    told = {}
    for name, clock in (("live", lambda: "16:02:11"), ("recorded", None)):
        monitor = Monitor(
            drive_frame=scene.DRIVE_FRAME,
            find_start=lambda _first: scene.START_NS,
            title="t",
            load_world=lambda _id: scene.junction(),
            clock=clock,
        )
        told[name] = text_of(Shown(monitor.handle("progress", progress))["status"])
    assert told["live"].startswith("**0.0 s**, now 16:02:11 · map: ")
    assert "now" not in told["recorded"]


def test_a_junction_whose_name_no_font_has_is_told_by_its_id() -> None:
    progress = next(m.message for m in scene.drive(duration_s=1.0) if m.channel == "progress")
    progress = msgspec.structs.replace(progress, next_intersection="東京通り", junction_id="n7")

    assert "next **… n7** in" in text_of(Shown(monitor_of().handle("progress", progress))["status"])


def test_threats_say_who_comes_from_where_how_likely_and_when() -> None:
    view = round_of(
        ("car", line((20.0, -20.0), (0.0, 10.0)), 1e-2),
        ("bicycle", line((20.0, 20.0), (0.0, -10.0)), 1e-5),
        ("pedestrian", line((20.0, 0.0), (0.0, 0.0)), 1e-7),
        likelihood=0.004,
    )
    shown = Shown(rows_of_round(view, 0))["world/futures/threats"]
    assert shown.labels.as_arrow_array().to_pylist() == [
        "car from the right · 1 in 200 · 2.0 s",
        "bicycle from the left · 1 in 200 · 2.0 s",
    ]
    np.testing.assert_allclose(
        shown.positions.as_arrow_array().to_pylist(), [[20.0, 0.0, 1.2]] * 2, atol=1e-5
    )
    assert not len(Shown(rows_of_round(round_of(), 0))["world/futures/threats"].labels)


def test_how_far_engines_are_apart_is_a_curve_for_each_future() -> None:
    monitor = monitor_of()
    one = SiblingFuture(
        round_id=1, stamp_ns=scene.state_at(7.0).stamp_ns, engine="multibody", which="worst",
        future_id="a-3", apart_1_s_m=0.1, apart_2_s_m=0.2, apart_4_s_m=None, heading_rad=0.0,
        collided=False, sibling_collided=False, matters=False, cpu_seconds=0.1, took_s=0.2,
        motion_sha256="",
    )  # fmt: skip
    shown = Shown(monitor.handle("sibling", one))
    scalars = shown["siblings/apart_m/worst"].scalars.as_arrow_array().to_pylist()
    assert scalars == [0.2], "the last that both have"
    nowhere = msgspec.structs.replace(one, apart_1_s_m=None, apart_2_s_m=None)
    assert monitor.handle("sibling", nowhere) == []
    opening = [row.path for row in monitor.opening()]
    assert {"siblings/apart_m/nominal", "siblings/apart_m/worst"} <= set(opening)
