"""A map file of any size as a stream of OPL, with its SHA-256 and how far it is read."""

from __future__ import annotations

import contextlib
import hashlib
import json
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import IO

from foretwin.contracts.world import ATTRIBUTION
from foretwin.world_gen.osm.map_file import HEAD_BYTES, MapHeader, file_fault, format_of, unreadable
from foretwin.world_gen.osm.opl import OPL_OPTIONS
from foretwin.world_gen.osm.osm_map import MapError

Progress = Callable[[int, int], None]
"""Called with the bytes read and the bytes of the file, from another thread."""
_FEED_BYTES = 1 << 20
BLOCK_BYTES = 8 << 20


class OplStream:
    """Yields blocks of whole lines; `header` and `sha256` are there when it has ended."""

    def __init__(self, path: Path, progress: Progress | None = None) -> None:
        self.path = path
        self.header = MapHeader(ATTRIBUTION, None)
        self._progress = progress
        self._sha256 = hashlib.sha256()
        self._said = b""
        try:
            self._file = path.open("rb")
            self._total = path.stat().st_size
            form = format_of(path, self._file.read(HEAD_BYTES))
        except OSError as error:
            raise file_fault(path, error) from None
        except MapError:
            self._file.close()
            raise
        self._file.seek(0)
        script = Path(__file__).with_name("opl_filter.py")
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(script), form, OPL_OPTIONS],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        self._threads = [threading.Thread(target=f, daemon=True) for f in (self._feed, self._hear)]

    @property
    def sha256(self) -> str:
        """Return the SHA-256 of the whole file, in hex."""
        return self._sha256.hexdigest()

    def __enter__(self) -> OplStream:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()
        for thread in self._threads:
            thread.join()
        for pipe in (self._process.stdout, self._process.stderr):
            _pipe(pipe).close()
        self._file.close()

    def blocks(self) -> Iterator[bytes]:
        """Yield the text in blocks of whole lines; MapError where the file is damaged."""
        left = b""
        output = _pipe(self._process.stdout)
        while block := output.read(BLOCK_BYTES):
            cut = block.rfind(b"\n") + 1
            if cut:
                yield left + block[:cut]
                left = block[cut:]
            else:
                left += block
        code = self._process.wait()
        for thread in self._threads:
            thread.join()
        if code != 0:
            reason = self._said.decode(errors="replace")
            raise unreadable(self.path, RuntimeError(reason or f"decoder ended with {code}"))
        self.header = MapHeader.of(**json.loads(self._said))

    def _feed(self) -> None:
        target = _pipe(self._process.stdin)
        done = 0
        # A decoder that gives up closes the pipe; what it said tells why.
        with contextlib.suppress(BrokenPipeError), target:
            while data := self._file.read(_FEED_BYTES):
                self._sha256.update(data)
                target.write(data)
                done += len(data)
                if self._progress is not None:
                    self._progress(done, self._total)

    def _hear(self) -> None:
        self._said = _pipe(self._process.stderr).read()


def _pipe(pipe: IO[bytes] | None) -> IO[bytes]:
    assert pipe is not None, "opened with PIPE"
    return pipe
