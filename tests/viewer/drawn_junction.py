"""A small hand-made junction: a signalised crossing of two streets with eight buildings."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.beside_road import Building
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.provenance import Choice, Quantity
from foretwin.contracts.signals import Signal
from foretwin.contracts.world import (
    Area,
    Connection,
    Crossing,
    IntersectionSummary,
    Lane,
    StopLine,
    World,
    WorldJunction,
)

WORLD_FRAME = LocalFrame(GeoPoint(52.5125, 13.3925))
"""The junction's own frame lies some 250 m away from the drive's."""
WORLD_ID = "a1b2c3d4e5f60718"
LANE_M = 3.25


def _box(x: float, y: float, dx: float, dy: float) -> Array:
    return np.array([[x, y], [x + dx, y], [x + dx, y + dy], [x, y + dy]], dtype=np.float64)


def _lane(name: str, line: list[list[float]], role: str) -> Lane:
    return Lane(
        id=name,
        osm_way=1,
        name="Kronenstraße" if name[0] in "we" else "東京通り",
        kind="driving",
        centerline=np.array(line, dtype=np.float64),
        width_m=Quantity(LANE_M, "default"),
        speed_limit_mps=Quantity(13.9, "tagged"),
        role=role,  # type: ignore[arg-type]
    )


def junction() -> World:
    """Return a signalised crossing of two streets with eight buildings, one with a courtyard."""
    half, near, far = LANE_M / 2.0, 9.0, 130.0
    lanes = (
        _lane("w_in", [[-far, -half], [-near, -half]], "approach"),
        _lane("e_out", [[near, -half], [far, -half]], "exit"),
        _lane("e_in", [[far, half], [near, half]], "approach"),
        _lane("w_out", [[-near, half], [-far, half]], "exit"),
        _lane("s_in", [[half, -far], [half, -near]], "approach"),
        _lane("n_out", [[half, near], [half, far]], "exit"),
        _lane("n_in", [[-half, far], [-half, near]], "approach"),
        _lane("s_out", [[-half, -near], [-half, -far]], "exit"),
    )
    turn = np.linspace(0.0, np.pi / 2.0, 9)
    left = np.column_stack(
        [-near + (near + half) * np.sin(turn), near - (near + half) * np.cos(turn)]
    )
    connections = tuple(
        Connection(
            id=name,
            from_lane_id="w_in",
            to_lane_id=to,
            turn=kind,  # type: ignore[arg-type]
            centerline=line,
            width_m=Quantity(LANE_M, "default"),
            control="signal",
        )
        for name, to, kind, line in (
            ("w_e", "e_out", "straight", np.array([[-near, -half], [near, -half]])),
            ("w_n", "n_out", "left", left),
        )
    )
    buildings = []
    rng = np.random.default_rng(1)
    for sx in (-1, 1):
        for sy in (-1, 1):
            for i in range(3):
                x, y = 12.0 + 34.0 * (i % 2), 12.0 + 30.0 * (i // 2)
                outline = _box(x, y, 28.0, 24.0) * [sx, sy]
                hole = _box(x + 9.0, y + 8.0, 10.0, 8.0) * [sx, sy]
                buildings.append(
                    Building(
                        id=f"b{sx}{sy}{i}",
                        outline=outline,
                        holes=(hole,) if i == 0 else (),
                        height_m=Quantity(
                            float(rng.uniform(9.0, 21.0)), ("tagged", "inferred", "default")[i]
                        ),
                    )
                )
    road = np.array(
        [
            [-far, -4],
            [-5, -4],
            [-4, -5],
            [-4, -far],
            [4, -far],
            [4, -5],
            [5, -4],
            [far, -4],
            [far, 4],
            [5, 4],
            [4, 5],
            [4, far],
            [-4, far],
            [-4, 5],
            [-5, 4],
            [-far, 4],
        ],
        dtype=np.float64,
    )
    summary = IntersectionSummary(
        id="x1",
        kind="crossing",
        lat=WORLD_FRAME.origin.lat_deg,
        lon=WORLD_FRAME.origin.lon_deg,
        arms=4,
        control="signals",
        driving_side="right",
        osm_nodes=(42,),
        name="Kronenstraße / 東京通り",
    )
    return World(
        id=WORLD_ID,
        intersection=summary,
        frame=WORLD_FRAME,
        radius_m=150.0,
        map_sha256="0" * 64,
        lanes=lanes,
        connections=connections,
        stop_lines=(
            StopLine(
                id="s1",
                lane_id="w_in",
                ends=np.array([[-9.0, 0.0], [-9.0, -4.0]]),
                control=Choice("signal", "inferred"),
            ),
        ),
        crossings=(
            Crossing(
                id="c1",
                line=np.array([[-7.0, -4.0], [-7.0, 4.0]]),
                width_m=Quantity(3.0, "default"),
                kind=Choice("zebra", "tagged"),
            ),
        ),
        signals=(
            Signal(
                id="g1",
                osm_node=7,
                group_id="g",
                lane_ids=("w_in",),
                position=np.array([-9.0, -5.0, 5.0]),
                yaw_rad=np.pi,
                source="tagged",
            ),
        ),
        islands=(Area(id="i1", outline=_box(-5.8, 4.8, 1.0, 1.0)),),
        kerbs=(road,),
        road_surface=(Area(id="r1", outline=road),),
        junctions=(
            WorldJunction(
                summary=summary,
                arms=(),
                area=Area(id="j1", outline=_box(-9.0, -4.0, 18.0, 8.0)),
            ),
        ),
        buildings=tuple(buildings),
    )
