"""The newest frame wins: whoever is slow misses frames, and nobody waits for anybody."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import pytest

from foretwin.viewer.copilot.feed import BEGIN_AGAIN_MS, MOST_PAGES, Feed, TooManyPagesError


async def taken(events: AsyncIterator[bytes]) -> str:
    return (await asyncio.wait_for(anext(events), 10.0)).decode().strip()


def test_a_page_that_comes_late_gets_the_newest_frame_and_each_one_once() -> None:
    async def story() -> None:
        feed = Feed()
        feed.publish(b"1", 7.25)
        events = feed.events()
        assert await taken(events) == f"retry: {BEGIN_AGAIN_MS}"
        feed.publish(b"2", 8.5)
        assert await taken(events) == "id: 8.500\ndata: 2"
        waits = asyncio.ensure_future(anext(events))
        await asyncio.sleep(0)
        assert not waits.done()
        feed.publish(b"3", 9.0)
        assert await waits == b"id: 9.000\ndata: 3\n\n"

    asyncio.run(story())


def test_a_frozen_page_misses_frames_and_others_do_not() -> None:
    async def story() -> None:
        feed = Feed()
        frozen, quick = feed.events(), feed.events()
        await taken(frozen)
        await taken(quick)
        for number in range(1000):
            feed.publish(b"%d" % number, float(number))
            assert await taken(quick) == f"id: {number}.000\ndata: {number}"
        assert await taken(frozen) == "id: 999.000\ndata: 999"

    asyncio.run(story())


def test_at_the_end_each_page_has_the_last_frame_and_goes() -> None:
    async def story() -> None:
        feed = Feed()
        events = feed.events()
        await taken(events)
        assert feed.pages == 1
        feed.publish(b"ended", 1.0)
        feed.close()
        assert await taken(events) == "id: 1.000\ndata: ended"
        with pytest.raises(StopAsyncIteration):
            await anext(events)
        assert feed.pages == 0

    asyncio.run(story())


def test_there_are_no_more_pages_than_seats() -> None:
    async def story() -> None:
        feed = Feed()
        pages = [feed.events() for _ in range(MOST_PAGES)]
        for page in pages:
            await taken(page)
        with pytest.raises(TooManyPagesError):
            await anext(feed.events())
        await pages[0].aclose()
        await taken(feed.events())

    asyncio.run(story())
