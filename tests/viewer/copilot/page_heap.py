"""What the page keeps: `python -m tests.viewer.copilot.page_heap --rate-hz 5 --frames 18000`.

Feeds the page in Chromium with the frames of a drive that goes on through junction after junction,
at its own pace of five a second or faster, and prints the heap after a collection every so often.
"""

from __future__ import annotations

import argparse
import threading
import time
from collections.abc import Iterator
from typing import NamedTuple

import msgspec

from foretwin.contracts.simulation import ActiveWorld
from foretwin.viewer.copilot.junction_plan import junction_plan
from tests.contracts.bus_sides import DEADLINE_S
from tests.viewer import scene
from tests.viewer.copilot.chromium import Browser
from tests.viewer.copilot.display import served_page
from tests.viewer.copilot.test_now import Drive, a_round

FRAME_S = 0.2
FRAMES_OF_AN_HOUR = 18_000
JUNCTION_S = 10.0
"""So often another junction comes, with a plan of its own."""


class HeapSeen(NamedTuple):
    """The heap after a collection, and how many frames the page had shown."""

    frames: int
    seconds: float
    heap_mb: float


def frames() -> Iterator[bytes]:
    """Yield what the display shows of a drive that never ends, each frame with its number."""
    drive, number = Drive(scene.junction()), 0
    while True:
        number += 1
        at_s = number * FRAME_S % JUNCTION_S
        drive.now.marks = number
        drive.goes_on(at_s)
        if number % 3 == 0:
            drive.take("round", a_round(at_s))
        if at_s < FRAME_S:
            drive.take("active_world", ActiveWorld(stamp_ns=number, world_id=f"w{number}"))
        yield msgspec.json.encode(drive.frame())


def measured(browser: Browser, *, count: int, rate_hz: float, looks: int) -> Iterator[HeapSeen]:
    """Show `count` frames, and look at the heap so many times in equal parts of them."""
    plan = msgspec.json.encode(junction_plan(scene.junction(), scene.DRIVE_FRAME))
    made, newest = frames(), [b"{}"]
    go, stop = threading.Event(), threading.Event()
    with served_page(lambda: newest[0], plan=plan) as (server, address):

        def feed() -> None:
            go.wait()
            for frame in made:
                newest[0] = frame
                server.publish(frame)
                if stop.wait(1.0 / rate_hz):
                    return

        feeding = threading.Thread(target=feed)
        feeding.start()
        server.publish(next(made))
        try:
            browser.do("open", url=address, size=(1024, 600))
            browser.do("count_changes", selector="#marks")
            begun_s = time.monotonic()
            go.set()
            for look in range(1, looks + 1):
                deadline_s = time.monotonic() + DEADLINE_S + 3.0 * count / looks / rate_hz
                while (shown := browser.do("changes")) < count * look // looks:
                    assert time.monotonic() < deadline_s, shown
                    time.sleep(0.2)
                yield HeapSeen(shown, time.monotonic() - begun_s, browser.do("heap_mb"))
            browser.do("close")
        finally:
            go.set()
            stop.set()
            feeding.join()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=FRAMES_OF_AN_HOUR)
    parser.add_argument("--rate-hz", type=float, default=1.0 / FRAME_S)
    parser.add_argument("--looks", type=int, default=12)
    given = parser.parse_args()
    browser = Browser()
    try:
        for one in measured(browser, count=given.frames, rate_hz=given.rate_hz, looks=given.looks):
            print(f"{one.frames:6d} frames, {one.seconds:6.0f} s, {one.heap_mb:.2f} MB", flush=True)
    finally:
        browser.close()


if __name__ == "__main__":
    main()
