"""Roles on screen: who is not there is not drawn, others look like their role, corrections show."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest

from foretwin.contracts.roles import ROLES, Role
from foretwin.contracts.simulation import MirroredVehicle, MirrorSample, TwinCorrection
from foretwin.viewer.log_roles import CARS, RolesLog, static_rows
from foretwin.viewer.rows import Row
from tests.viewer import scene

DRAWN = TwinCorrection(along_mps2=0.5, across_mps2=-0.25, yaw_radps2=0.0)


def van(role: Role) -> MirroredVehicle:
    sample = scene.mirror_at(3.0)
    return MirroredVehicle(
        vehicle_id="van 7",
        role=role,
        real=sample.real,
        shown=sample.twin,
        length_m=4.6,
        width_m=1.9,
        height_m=2.0,
        rear_overhang_m=0.9,
    )


def sample(at_s: float = 3.0, **changes: Any) -> MirrorSample:
    return msgspec.structs.replace(scene.mirror_at(at_s), **changes)


def by_path(rows: list[Row]) -> dict[str, Any]:
    return {row.path: row.components for row in rows}


def scale_of(transform: Any) -> list[float] | None:
    cells = transform.scale
    return None if cells is None else cells.as_arrow_array().to_pylist()[0]


def test_only_who_is_there_is_drawn_once_roles_are_used() -> None:
    log = RolesLog()
    before = by_path(log.rows(sample(), 1))
    assert set(before) == {"world/ego/twin", "world/ego/shadow", "world/ego/ghost"}
    assert {scale_of(row) is None for row in before.values()} == {True}
    for role, there in (("shadow", {"shadow"}), ("all", {"twin", "shadow", "ghost"})):
        rows = by_path(log.rows(sample(role=role), 2))
        drawn = {
            name
            for name in ("twin", "shadow", "ghost")
            if scale_of(rows[f"world/ego/{name}"]) == [1.0] * 3
        }
        assert drawn == there


@pytest.mark.parametrize("role", ROLES)
def test_a_vehicle_beside_has_the_colour_of_its_role_and_its_own_size(role: Role) -> None:
    rows = by_path(RolesLog().rows(sample(others=(van(role),)), 1))
    path = next(path for path in rows if path.startswith("world/others/") and path.endswith("/box"))
    colour = rows[path].colors.as_arrow_array().to_pylist()[0]
    red, green, blue = CARS["twin" if role == "all" else role][0]
    assert colour >> 8 == (red << 16) + (green << 8) + blue
    half = rows[path].half_sizes.as_arrow_array().to_pylist()[0]
    assert half[0] == pytest.approx(2.3, abs=0.1)


def test_a_box_is_sent_as_the_role_changes_alone_and_cleared_as_the_vehicle_goes() -> None:
    log = RolesLog()
    boxes = []
    for role in ("twin", "twin", "ghost", "ghost"):
        rows = log.rows(sample(others=(van(role),)), 1)  # type: ignore[arg-type]
        boxes.append(
            sum(row.path.startswith("world/others/") and row.path.endswith("/box") for row in rows)
        )
    assert boxes == [1, 0, 1, 0]
    gone = [row.path for row in log.rows(sample(), 2) if "others" in row.path]
    assert len(gone) == 2
    assert not [row for row in log.rows(sample(), 3) if "others" in row.path]


def test_a_correction_is_an_arrow_and_two_curves_until_it_ends() -> None:
    log = RolesLog()
    free = scene.mirror_at(3.0).real
    rows = by_path(log.rows(sample(correction=DRAWN, free=free), 1))
    vector = rows["world/ego/twin/correction"].vectors.as_arrow_array().to_pylist()[0]
    assert vector == [2.0, -1.0, 0.0]
    assert {"correction/along", "correction/across", "world/ego/free"} <= set(rows)
    after = by_path(log.rows(sample(), 2))
    assert {"world/ego/twin/correction", "world/ego/free"} <= set(after)
    assert len(log.rows(sample(), 3)) == 3


def test_the_curves_and_the_arrow_of_a_correction_have_their_looks_once() -> None:
    corrected = RolesLog().rows(sample(role="all", correction=DRAWN), 1)
    styled = by_path(static_rows())
    assert {path for path in by_path(corrected) if "correction" in path} == set(styled)
