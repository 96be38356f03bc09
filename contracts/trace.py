"""What a process does when: spans on the host's monotonic clock, as a Chrome trace that Perfetto
opens.

Off unless `begin` was called: a span costs then less than a microsecond. Each process writes
a file of its own that only grows, so that a killed one leaves what it did; `joined` makes one of
them.
"""

from __future__ import annotations

import contextlib
import functools
import os
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Protocol, TypeVar, cast

import msgspec

_Work = TypeVar("_Work", bound=Callable[..., Any])

MOST_BYTES = 24_000_000
"""What one process writes at most; later spans are counted and left out."""
_AT_ONCE = 256
"""Events that are written together."""
TRACE, TRACE_PARTS = "trace.json", "trace"
"""In a run's folder: the trace, and until the drive's end the folder of its parts."""
_SUFFIX = ".trace"
_TOLD_FROM_NS = 500_000
READY_MS = "ready_without_processor_ms"
"""Of spans that last longer than `_TOLD_FROM_NS`: how long the thread would have run and could not.
What is neither this nor CPU time it has waited: for a lock, a disk, an answer."""


class Span(Protocol):
    """A piece of work, for a `with` statement."""

    def __enter__(self) -> object:
        """Begin it."""

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End it."""


class _Unrecorded:
    def __enter__(self) -> None:
        return None

    def __exit__(self, *_: object) -> None:
        return None


class _Recorded:
    __slots__ = ("_args", "_began_cpu_ns", "_began_ns", "_name", "_ready_ns", "_recorder")

    def __init__(self, recorder: _Recorder, name: str, args: dict[str, Any]) -> None:
        self._recorder, self._name, self._args = recorder, name, args

    def __enter__(self) -> None:
        self._ready_ns = _thread.stat.ready_ns()
        self._began_ns = time.monotonic_ns()
        self._began_cpu_ns = time.thread_time_ns()

    def __exit__(self, *_: object) -> None:
        cpu_ns, ended_ns = time.thread_time_ns(), time.monotonic_ns()
        if ended_ns - self._began_ns > _TOLD_FROM_NS:
            self._args[READY_MS] = (_thread.stat.ready_ns() - self._ready_ns) / 1e6
        event = {
            "tts": self._began_cpu_ns / 1e3,
            "tdur": (cpu_ns - self._began_cpu_ns) / 1e3,
            "dur": (ended_ns - self._began_ns) / 1e3,
            "args": self._args,
        }
        self._recorder.add("X", self._name, self._began_ns, event)


class _SchedStat:
    """Where the kernel says how long a thread was ready and had no processor, open while it lives.

    A thread that is not ours is a new one to Python each time that it calls in.
    """

    def __init__(self) -> None:
        try:
            self._file = os.open(
                f"/proc/self/task/{threading.get_native_id()}/schedstat", os.O_RDONLY
            )
        except OSError:
            self._file = -1

    def ready_ns(self) -> int:
        return int(os.pread(self._file, 64, 0).split()[1]) if self._file >= 0 else 0

    def __del__(self) -> None:
        if self._file >= 0:
            os.close(self._file)


class _Thread(threading.local):
    def __init__(self) -> None:
        self.stat = _SchedStat()


_thread = _Thread()
os.register_at_fork(after_in_child=_thread.__init__)  # type: ignore[misc]


class _Recorder:
    def __init__(self, file: IO[bytes], process_id: str) -> None:
        self._file = file
        self._pid = os.getpid()
        self._events: list[dict[str, Any]] = []
        self._lock = threading.Lock()
        self._encoder = msgspec.json.Encoder()
        self._written, self._left_out = 0, 0
        self._meta("process_name", {"name": process_id})

    def add(self, kind: str, name: str, began_ns: int, more: dict[str, Any]) -> None:
        if self._written > MOST_BYTES:
            self._left_out += 1
            return
        event = {"ph": kind, "name": name, "pid": self._pid, "tid": threading.get_native_id()}
        self._events.append(event | {"ts": began_ns / 1e3} | more)
        if len(self._events) >= _AT_ONCE:
            self.write()

    def _meta(self, name: str, args: dict[str, Any]) -> None:
        self._events.append({"ph": "M", "name": name, "pid": self._pid, "tid": 0, "args": args})

    def write(self) -> None:
        with self._lock:
            events, self._events = self._events, []
            data = b"".join(self._encoder.encode(event) + b"\n" for event in events)
            self._written += len(data)
            with contextlib.suppress(OSError):  # a full disk must not end a drive
                self._file.write(data)

    def close(self) -> None:
        if self._left_out:
            self._meta("process_labels", {"labels": f"{self._left_out} spans left out"})
        self.write()
        with contextlib.suppress(OSError):
            self._file.close()


_UNRECORDED = _Unrecorded()
_recorder: _Recorder | None = None


def begin(folder: Path, process_id: str) -> None:
    """Record the spans of this process from now on, into a file of its own in `folder`."""
    global _recorder
    folder.mkdir(exist_ok=True)
    file = (folder / f"{process_id}-{os.getpid()}{_SUFFIX}").open("ab", buffering=0)
    _recorder = _Recorder(file, process_id)


def end() -> None:
    """Write what is left, and record nothing any more."""
    global _recorder
    if _recorder is not None:
        _recorder.close()
    _recorder = None


def span(name: str, **args: Any) -> Span:
    """Return a span of this thread, with its CPU time beside its wall time."""
    return _UNRECORDED if _recorder is None else _Recorded(_recorder, name, args)


def traced(name: str) -> Callable[[_Work], _Work]:
    """Return a decorator that makes every call of a function a span."""

    def decorate(work: _Work) -> _Work:
        @functools.wraps(work)
        def spanned(*args: Any, **kwargs: Any) -> Any:
            if _recorder is None:
                return work(*args, **kwargs)
            with span(name):
                return work(*args, **kwargs)

        return cast(_Work, spanned)

    return decorate


def item_name(item: object) -> str:
    """Return what taking an item of a mailbox is called: its channel, or its kind."""
    return getattr(item, "channel", type(item).__name__)


def since(name: str, began_mono_ns: int, **args: Any) -> None:
    """Record what has lasted from a time until now on no thread: waiting, or a whole round."""
    if _recorder is not None:
        number = f"{name} {began_mono_ns}"
        more = {"cat": "waiting", "id2": {"local": number}, "args": args}
        _recorder.add("b", name, began_mono_ns, more)
        _recorder.add("e", name, time.monotonic_ns(), more)


def sent(name: str, key: str) -> None:
    """Begin an arrow to where another process calls `came` with the same name and key."""
    if _recorder is not None:
        _recorder.add("s", name, time.monotonic_ns(), {"cat": "bus", "id": f"{name} {key}"})


def came(name: str, key: str) -> None:
    """End the arrow that `sent` began; call it within the span that it shall point to."""
    if _recorder is not None:
        more = {"cat": "bus", "id": f"{name} {key}", "bp": "e"}
        _recorder.add("f", name, time.monotonic_ns(), more)


@contextlib.contextmanager
def whole_run(folder: Path | None, process_id: str) -> Iterator[None]:
    """Record what this process does, and at the end join what all have left in `folder` to the
    trace beside it; nothing where there is no folder."""
    if folder is None:
        yield
        return
    begin(folder, process_id)
    try:
        yield
    finally:
        end()
        joined(folder, folder.with_name(TRACE))


def joined(folder: Path, file: Path) -> int:
    """Make one trace of all in `folder`, which is removed; returns the events in it.

    Lines that a kill cut short are left out.
    """
    count = 0
    with file.open("wb") as out:
        out.write(b'{"displayTimeUnit":"ms","traceEvents":[\n')
        for part in sorted(folder.glob(f"*{_SUFFIX}")):
            with part.open("rb") as lines:
                for line in lines:
                    if line.endswith(b"}\n"):
                        out.write((b",\n" if count else b"") + line[:-1])
                        count += 1
            part.unlink()
        out.write(b"\n]}\n")
    folder.rmdir()
    return count
