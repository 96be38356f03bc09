"""A progress bar on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from foretwin.contracts.terminal import console, described, plain, visible

PLAIN_PERIOD_S = 5.0
"""Between lines of progress where there is no terminal."""


@contextmanager
def progress_bar(
    total: int, what: str
) -> Iterator[tuple[Callable[..., None], Callable[[str], None]]]:
    """Give a function that counts one more of a name, or `by` so many, and one that prints a line
    beside the bar."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    shown = console(error=True)

    def say(text: str) -> None:
        shown.print(visible(text), soft_wrap=True)

    if shown.is_terminal:
        counted = BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
        with Progress(described(), *counted, console=shown) as bar:
            task = bar.add_task(what, total=total)

            def show(name: str, *, by: int = 1) -> None:
                bar.update(task, advance=by, description=plain(name))

            yield show, say
        return
    done, last_s = 0, time.monotonic()

    def advance(name: str, *, by: int = 1) -> None:
        nonlocal done, last_s
        done += by
        if time.monotonic() - last_s >= PLAIN_PERIOD_S:
            last_s = time.monotonic()
            say(f"{done} of {total} {what}, {name}")

    yield advance, say
