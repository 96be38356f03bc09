"""A car that turns back in its road, as its route does or not."""

from __future__ import annotations

import pytest

from foretwin.orchestrator.routing.line_matching import SPACING_M
from tests.orchestrator.routing.grid_driver import Driver, route_of

TURNED_BETWEEN_NODES = [(20, 98), (150, 98), (150, 104), (20, 103)]


@pytest.mark.parametrize(
    "there",
    [
        [(150, 98), (150, 104)],
        [(200, 98), (206, 100), (200, 104)],
        [(190, 98), (193, 100), (190, 104)],
        [(196, 98), (200, 92), (204, 98), (204, 104)],
        [(196, 98), (202, 90), (202, 84), (198, 84), (198, 104)],
    ],
    ids=["on the road", "at a node", "before a node", "round a corner", "by a side street"],
)
def test_a_car_that_turns_back_as_its_log_did_never_leaves_its_route(
    there: list[tuple[float, float]],
) -> None:
    corners = [(20.0, 98.0), *there, (20.0, 103.0)]
    driver = Driver(route_of(corners)).go(corners)

    assert [now for now in driver.progress if now is None or now.off_route] == []
    assert driver.names[-1] == "n102"


def test_a_car_that_drives_on_where_its_route_turns_back_has_left_it() -> None:
    driver = Driver(route_of([(20, 98), (200, 98), (206, 100), (200, 104), (20, 103)]))
    driver.go([(20, 98), (240, 98)])

    assert driver.progress[-1] is not None
    assert driver.progress[-1].off_route


def test_beyond_where_a_route_turns_back_between_nodes_no_junction_is_ahead() -> None:
    driver = Driver(route_of(TURNED_BETWEEN_NODES)).go([(20, 98), (120, 98)])
    name, distance_m = driver.ahead()[0]

    assert name == "n102"
    assert distance_m == pytest.approx(80, abs=SPACING_M)
    assert "n103" not in [name for name, _ in driver.ahead()]


def test_a_car_that_drives_on_where_its_route_turns_between_nodes_has_left_it() -> None:
    driver = Driver(route_of(TURNED_BETWEEN_NODES)).go([(20, 98), (165, 98)])
    assert [now for now in driver.progress if now is None or now.off_route] == []
    driver.go([(166, 98), (194, 98)])

    assert driver.progress[-1] is not None
    assert driver.progress[-1].off_route
    assert driver.ahead(50.0) == [("n103", 6)]
    # Where it goes on it turns off as well as before, and back there it is on its route again.
    driver.go([(196, 98), (204, 98), (204, 104), (150, 103)])
    assert driver.progress[-1] is not None
    assert driver.ahead(50.0)[0] == ("n102", pytest.approx(50, abs=2))
    assert not driver.progress[-1].off_route
