"""A page on which a click takes a place on a lane: what stands in it, and a browser that clicks."""

from __future__ import annotations

import json
import re
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from foretwin.contracts.anchor import AnchorPose
from foretwin.contracts.frames import local_from_geo, local_from_geo_yaw
from foretwin.contracts.world import World
from foretwin.orchestrator.commands.anchor_page import anchor_page, lane_points
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.embedded import MAP_FILE
from tests.sim_worker.places import crossroads
from tests.viewer.copilot.chromium import CHROMIUM, judges_python

PLACE = "45.0,-30.0011415"
CLICK = """
import sys
from playwright.sync_api import sync_playwright

with sync_playwright() as playwright:
    browser = playwright.chromium.launch(executable_path=sys.argv[1], args=["--no-sandbox"])
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    page.on("request", lambda asked: asked.url.startswith("file:") or sys.exit(asked.url))
    page.goto("file://" + sys.argv[2])
    x, y = (float(one) for one in sys.argv[3:5])
    box, wide = page.locator("svg").bounding_box(), page.evaluate(
        "document.querySelector('svg').viewBox.baseVal.width")
    page.mouse.click(box["x"] + x * box["width"] / wide, box["y"] + y * box["width"] / wide)
    print(page.locator("#table").inner_text())
    browser.close()
"""


@pytest.fixture(scope="module")
def world() -> World:
    return crossroads()


def lanes_in(page: str) -> list[dict[str, Any]]:
    (told,) = re.findall(r'<script id="lanes" type="application/json">(.*?)</script>', page)
    found: list[dict[str, Any]] = json.loads(told)
    return found


def test_points_lie_on_their_lane_and_look_along_it(world: World) -> None:
    for lane in world.lanes:
        found = lane_points(world, lane, west_m=-160.0, north_m=100.0)
        line = np.asarray(lane.centerline)[:, :2]
        lat, lon = np.array(found["lat_lon_deg"]).T
        assert local_from_geo(world.frame, lat, lon) == pytest.approx(line, abs=1e-3)
        assert found["drawn"][0] == pytest.approx(
            [10.0 * (line[0, 0] + 160.0), 10.0 * (100.0 - line[0, 1])], abs=0.01
        )
        step = line[1] - line[0]
        yaw_rad = local_from_geo_yaw(world.frame, np.radians(found["yaw_deg"][0]), lat[0], lon[0])
        off_rad = float(yaw_rad) - float(np.arctan2(step[1], step[0]))
        assert abs(np.angle(np.exp(1j * off_rad))) < 1e-5


def test_the_page_asks_for_nothing_and_strangers_names_do_nothing(world: World) -> None:
    hostile = "</script><img src=x>"
    lanes = tuple(msgspec.structs.replace(lane, name=hostile) for lane in world.lanes)
    page = anchor_page(msgspec.structs.replace(world, lanes=lanes), radius_m=100.0)
    assert hostile not in page
    assert "http" not in page.replace("http://www.w3.org/2000/svg", "")
    assert {one["name"] for one in lanes_in(page)} == {hostile}


def test_the_command_writes_it_beside_the_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "new" / "place.html"
    assert run(["anchor", str(MAP_FILE), "--at", PLACE, "--page", str(page)]) == 0
    said = capsys.readouterr().out
    assert f"# wrote {page}" in said
    assert set(tomllib.loads(said)) == {"world"}
    assert lanes_in(page.read_text())


@pytest.mark.parametrize(("name", "said"), [("a.png", "a.html"), ("a.html", "is a folder")])
def test_what_can_be_no_page_is_refused_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, said: str
) -> None:
    (tmp_path / "a.html").mkdir()
    page = str(tmp_path / name)
    assert run(["anchor", "no-map.osm", "--at", PLACE, "--page", page]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.judge
def test_a_click_in_a_browser_tells_the_place_under_it(tmp_path: Path) -> None:
    python = judges_python()
    page = tmp_path / "place.html"
    assert run(["anchor", str(MAP_FILE), "--at", PLACE, "--page", str(page)]) == 0
    lane = max(lanes_in(page.read_text()), key=lambda one: np.ptp(one["drawn"], axis=0).max())
    a, b = np.array(lane["drawn"][:2])
    x, y = (0.3 * a + 0.7 * b).tolist()
    asked = [str(python), "-c", CLICK, str(CHROMIUM), str(page), str(x), str(y)]
    said = subprocess.run(asked, capture_output=True, text=True, check=True, timeout=120).stdout
    pose = AnchorPose(**tomllib.loads(said)["world"])
    frame = AnchorPose(lat_deg=pose.lat_deg, lon_deg=pose.lon_deg, yaw_deg=0.0).frame
    ends = np.array([local_from_geo(frame, *one) for one in lane["lat_lon_deg"][:2]])
    assert 0.3 * ends[0] + 0.7 * ends[1] == pytest.approx([0.0, 0.0], abs=0.4)
    assert lane["id"] in said
    assert pose.yaw_deg == pytest.approx(lane["yaw_deg"][0], abs=0.01)
