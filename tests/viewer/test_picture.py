"""What a person sees: the recording rendered without a display, and proof that emptiness shows."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest

from foretwin.viewer.blueprint import drive_blueprint
from foretwin.viewer.colours import CRITICAL, TWIN
from foretwin.viewer.log_drive import LIMIT
from foretwin.viewer.log_world import ROAD
from foretwin.viewer.monitor import Monitor
from foretwin.viewer.picture import Picture, has_vulkan, main, take_picture
from foretwin.viewer.rows import Row, document, plain_text
from foretwin.viewer.sinks import FileStream
from foretwin.viewer.views import title_of
from tests.viewer import scene

COVERS = ("foretwin.viewer.blueprint", "foretwin.viewer.views")
GAPS = [title_of("position_gap"), title_of("heading_gap"), title_of("speed_gap")]

pytestmark = pytest.mark.picture
SIZE = (1200, 800)
AT_S = 7.0


@pytest.fixture(scope="module", autouse=True)
def _needs_vulkan() -> None:
    if has_vulkan():
        return
    if os.environ.get("FORETWIN_REQUIRE_PICTURE") == "1":
        pytest.fail("FORETWIN_REQUIRE_PICTURE=1, but no Vulkan driver is installed")
    pytest.skip("no Vulkan driver to render with (Debian: mesa-vulkan-drivers)")


def _record(path: Path, *, without: tuple[str, ...] = (), more: Sequence[Row] = ()) -> Path:
    monitor = Monitor(
        drive_frame=scene.DRIVE_FRAME,
        find_start=lambda _first: scene.START_NS,
        title="hand-made drive",
        load_world=lambda _id: scene.junction(),
    )
    file = FileStream(path, recording_id=path.stem, title="t", blueprint=drive_blueprint())
    file.write(monitor.opening())
    for channel, message in scene.drive(duration_s=AT_S + 1.0):
        if channel not in without:
            file.write(monitor.handle(channel, message))
    file.write(more)
    file.close()
    return path


def _pixels(png: bytes) -> np.ndarray[Any, Any]:
    return matplotlib.image.imread(io.BytesIO(png), format="png")[..., :3] * 255.0


def _count(png: bytes, colour: tuple[int, int, int], *, within: float = 24.0) -> int:
    """Return how many pixels have about this colour."""
    return int((np.abs(_pixels(png) - np.array(colour)).max(axis=2) < within).sum())


def _contrast(png: bytes) -> float:
    """Return the standard deviation of the pixels' brightness, 0..255."""
    return float(_pixels(png).mean(axis=2).std())


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Picture:
    folder = tmp_path_factory.mktemp("whole")
    return take_picture(_record(folder / "whole.rrd"), at_s=AT_S, size=SIZE)


@pytest.fixture(scope="module")
def empty(tmp_path_factory: pytest.TempPathFactory) -> Picture:
    folder = tmp_path_factory.mktemp("empty")
    missing = ("world", "active_world", "mirror", "round", "plan", "state")
    recording = _record(folder / "empty.rrd", without=missing)
    return take_picture(recording, at_s=AT_S, size=SIZE)


def test_the_3d_view_shows_roads_buildings_and_futures(whole: Picture, empty: Picture) -> None:
    full, bare = whole.views["Intersection"], empty.views["Intersection"]
    assert _contrast(full) > 25.0
    assert _count(full, ROAD) > 5000
    assert _count(full, CRITICAL, within=40.0) > 200
    assert _contrast(bare) < 10.0
    assert _count(bare, ROAD) == 0
    assert _count(bare, CRITICAL, within=40.0) == 0


@pytest.mark.parametrize("name", GAPS)
def test_each_gap_plot_shows_its_curve_and_limit(whole: Picture, empty: Picture, name: str) -> None:
    # Limits that grow with the time since the twin began anew leave a small curve little height.
    assert _count(whole.views[name], TWIN) > 100
    assert _count(whole.views[name], LIMIT, within=40.0) > 150
    assert _count(empty.views[name], TWIN) == 0
    assert _count(empty.views[name], LIMIT, within=40.0) == 0


def test_every_letter_that_names_keep_is_drawn(tmp_path: Path, whole: Picture) -> None:
    """Rerun's viewer ends at the first letter that its font lacks."""
    letters = plain_text("".join(map(chr, range(0x250, 0x2000))))
    status = Row("status", round(1e9 * AT_S), document(letters))
    recording = _record(tmp_path / "letters.rrd", more=[status])
    shown = take_picture(recording, at_s=AT_S, size=SIZE)
    assert _contrast(shown.views["Status"]) > 1.2 * _contrast(whole.views["Status"])


def test_views_behind_tabs_are_not_on_the_picture(whole: Picture) -> None:
    assert set(whole.views) >= {"Intersection", *GAPS, "Futures", "Legend", "Status"}
    assert "Chase" not in whole.views
    assert _pixels(whole.window).shape == (SIZE[1], SIZE[0], 3)


def test_the_command_writes_a_picture(tmp_path: Path) -> None:
    out = tmp_path / "out.png"
    options = ["--at", "3", "--layout", "gap", "--show", "map", "--size", "800x600"]
    assert main([str(_record(tmp_path / "drive.rrd")), str(out), *options]) == 0
    assert _contrast(out.read_bytes()) > 25.0


def test_what_is_no_recording_is_told_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(tmp_path / "none.rrd"), str(tmp_path / "out.png")]) == 2
    (tmp_path / "text.rrd").write_text("no recording")
    assert main([str(tmp_path / "text.rrd"), str(tmp_path / "out.png")]) == 2
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 2
    assert "none.rrd" in told[0]
    assert "text.rrd" in told[1]


def test_drivers_that_the_environment_names_count_alone(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("VK_ICD_FILENAMES", raising=False)
    monkeypatch.setenv("VK_DRIVER_FILES", str(tmp_path / "none.json"))
    assert not has_vulkan()
    (tmp_path / "there.json").touch()
    monkeypatch.setenv("VK_DRIVER_FILES", f"{tmp_path / 'none.json'}:{tmp_path / 'there.json'}")
    assert has_vulkan()
