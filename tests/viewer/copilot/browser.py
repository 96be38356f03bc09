"""Drives a headless Chromium for the judges: one JSON order a line, one JSON answer a line.

Runs in an environment of its own, with playwright; started as a script, never imported.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from playwright.sync_api import sync_playwright

KEY_TEXT = ("#arrival", "#junction", "#control-text", "#twin-text", "#danger", "#speed-value")
MEASURE = """names => Object.fromEntries(names.map(name => {
  const one = document.querySelector(name), box = one.getBoundingClientRect();
  const outer = document.querySelector('#now').getBoundingClientRect();
  const within = document.querySelector('#now').contains(one);
  return [name, {font_px: parseFloat(getComputedStyle(one).fontSize),
    inside: box.width > 0 && box.left >= 0 && box.right <= innerWidth && box.bottom <= innerHeight
      && (getComputedStyle(one).display === 'inline'
        || one.scrollHeight <= 1.3 * one.clientHeight + 6)
      && (!within || box.bottom <= outer.bottom)}];
}))"""


class Pages:
    """The page that is open, and what it asked for."""

    def __init__(self, browser: Any) -> None:
        self._browser, self._page, self._context = browser, None, None
        self._asked: list[str] = []
        self._host = ""

    def open(self, url: str, size: list[int], theme: str = "dark") -> None:
        self.close()
        self._host, self._asked = urlsplit(url).netloc, []
        view = {"width": size[0], "height": size[1]}
        self._context = self._browser.new_context(viewport=view, color_scheme=theme)
        self._page = self._context.new_page()
        self._page.on("request", lambda asked: self._asked.append(asked.url))
        self._page.goto(url)
        self._page.wait_for_selector("body[data-ready=yes]")

    def close(self) -> None:
        if self._context is not None:
            self._context.close()
        self._page = self._context = None

    def shoot(self, url: str, file: str, size: list[int]) -> None:
        self.open(url, size)
        self._page.screenshot(path=file)

    def measure(self, url: str, size: list[int]) -> Any:
        self.open(url, size)
        return self._page.evaluate(MEASURE, KEY_TEXT)

    def axe(self, url: str, size: list[int], theme: str) -> Any:
        from axe_playwright_python.sync_playwright import Axe

        self.open(url, size, theme)
        found = Axe().run(self._page).response["violations"]
        return [[one["id"], *(node["html"][:80] for node in one["nodes"])] for one in found]

    def wait(self, selector: str) -> None:
        self._page.wait_for_selector(selector, state="attached")

    def box(self, selector: str) -> Any:
        return self._page.evaluate(
            "one => document.querySelector(one).getBoundingClientRect().toJSON()", selector
        )

    def text(self, selector: str) -> str:
        return str(self._page.inner_text(selector))

    def click(self, selector: str) -> None:
        self._page.click(selector)

    def press(self, key: str) -> None:
        self._page.keyboard.press(key)

    def outside(self) -> list[str]:
        assert self._asked
        return [one for one in self._asked if urlsplit(one).netloc != self._host]

    def count_changes(self, selector: str) -> None:
        """Count from now on how often an element's text changes."""
        self._page.evaluate(
            """one => {
              window.changes = 0;
              new MutationObserver(() => { window.changes += 1; })
                .observe(document.querySelector(one), { childList: true });
            }""",
            selector,
        )

    def changes(self) -> int:
        return int(self._page.evaluate("window.changes"))

    def heap_mb(self) -> float:
        session = self._context.new_cdp_session(self._page)
        session.send("HeapProfiler.collectGarbage")
        used = session.send("Runtime.getHeapUsage")["usedSize"]
        return used / 1e6

    def freeze(self) -> list[int]:
        """Stop the processes that draw pages."""
        stopped = []
        for place in Path("/proc").iterdir():
            with contextlib.suppress(OSError, ValueError):
                pid = int(place.name)
                line = (place / "cmdline").read_text()
                if "--type=renderer" in line and os.getpid() in _parents(pid):
                    os.kill(pid, signal.SIGSTOP)
                    stopped.append(pid)
        assert stopped
        return stopped

    def thaw(self, pids: list[int]) -> None:
        for pid in pids:
            os.kill(pid, signal.SIGCONT)


def _parents(pid: int) -> list[int]:
    found = []
    while pid > 1:
        stat = Path(f"/proc/{pid}/stat").read_text()
        pid = int(stat.rsplit(")", 1)[1].split()[1])
        found.append(pid)
    return found


def main() -> None:
    with sync_playwright() as tools:
        browser = tools.chromium.launch(
            executable_path=sys.argv[1], args=["--no-sandbox", "--js-flags=--expose-gc"]
        )
        pages = Pages(browser)
        for line in sys.stdin:
            order = json.loads(line)
            answer = getattr(pages, order.pop("do"))(**order)
            print(json.dumps(answer), flush=True)
        pages.close()
        browser.close()


if __name__ == "__main__":
    main()
