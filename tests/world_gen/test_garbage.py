"""How often garbage is looked for is the caller's, but while a map is read or a World built."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest

from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.world_gen.build import build_world
from foretwin.world_gen.garbage import COLLECT_AFTER, rarely_collected
from foretwin.world_gen.opening import open_map

USUAL = (700, 10, 10)


@pytest.fixture(autouse=True)
def usual() -> Iterator[None]:
    before = gc.get_threshold()
    gc.set_threshold(*USUAL)
    yield
    gc.set_threshold(*before)


def test_who_opens_a_map_and_builds_a_world_looks_for_garbage_as_often_as_before() -> None:
    opened = open_map(MAP_FILE)
    assert gc.get_threshold() == USUAL
    build_world(opened.osm, opened.graph, opened.junctions[0])
    assert gc.get_threshold() == USUAL


def test_it_is_looked_for_rarely_meanwhile_and_again_whatever_happens() -> None:
    @rarely_collected()
    def fails() -> None:
        assert gc.get_threshold() == (COLLECT_AFTER, 10, 10)
        raise RuntimeError

    with pytest.raises(RuntimeError):
        fails()
    assert gc.get_threshold() == USUAL


@pytest.mark.parametrize("threshold", [0, 2 * COLLECT_AFTER])
def test_who_looks_more_rarely_or_never_goes_on_so(threshold: int) -> None:
    gc.set_threshold(threshold, 10, 10)
    with rarely_collected():
        assert gc.get_threshold()[0] == threshold


def test_of_two_at_once_the_last_one_puts_it_back() -> None:
    first, second = rarely_collected(), rarely_collected()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert gc.get_threshold()[0] == COLLECT_AFTER
    second.__exit__(None, None, None)
    assert gc.get_threshold() == USUAL
