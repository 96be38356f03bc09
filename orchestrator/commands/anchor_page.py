"""A page on which a click on a lane says where in a World a lot is anchored."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from foretwin.contracts.frames import geo_from_local, geo_from_local_yaw
from foretwin.contracts.world import Lane, World
from foretwin.orchestrator.report.drawing import UNITS_PER_M, Canvas
from foretwin.orchestrator.report.junction_picture import draw_ground
from foretwin.world_gen.export import picture_style as style

_ASPECT = 1.6


def anchor_page(world: World, *, radius_m: float) -> str:
    """Return an HTML file that needs no network and no other file: the World so far around its
    middle, and at a click the nearest pose on a lane, as the [world] of an anchor file."""
    canvas = Canvas(-_ASPECT * radius_m, -radius_m, _ASPECT * radius_m, radius_m)
    draw_ground(canvas, world)
    canvas.scale_bar()
    environment = jinja2.Environment(
        autoescape=True,
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        undefined=jinja2.StrictUndefined,
    )
    name = world.intersection.name or world.intersection.id
    return environment.get_template("anchor_page.html.j2").render(
        name=name,
        svg=canvas.svg(f"{name} from above", style.GROUND),
        lanes=[
            lane_points(world, lane, west_m=-_ASPECT * radius_m, north_m=radius_m)
            for lane in world.lanes
            if lane.kind != "tram" and len(lane.centerline) > 1
        ],
        attribution=world.attribution,
    )


def lane_points(world: World, lane: Lane, *, west_m: float, north_m: float) -> dict[str, Any]:
    """Return a lane as the page has it: its points (N) in units of the picture, as latitudes and
    longitudes, and of each of its N - 1 pieces the yaw in degrees from true east."""
    line = np.asarray(lane.centerline, dtype=np.float64)[:, :2]
    step = np.diff(line, axis=0)
    middle = 0.5 * (line[1:] + line[:-1])
    yaw_rad = geo_from_local_yaw(world.frame, np.arctan2(step[:, 1], step[:, 0]), middle)
    drawn = (line - (west_m, north_m)) * (UNITS_PER_M, -UNITS_PER_M)
    return {
        "id": lane.id,
        "name": lane.name or "a road without a name",
        "drawn": np.round(drawn, 2).tolist(),
        "lat_lon_deg": np.round(geo_from_local(world.frame, line), 9).tolist(),
        "yaw_deg": np.round(np.degrees(yaw_rad), 4).tolist(),
    }
