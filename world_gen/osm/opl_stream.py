"""A map file of any size as a stream of OPL, with its SHA-256 and how far it is read."""

from __future__ import annotations

import contextlib
import hashlib
import json
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO

from foretwin.contracts.world import ATTRIBUTION
from foretwin.world_gen.osm.map_file import (
    HEAD_BYTES,
    MapHeader,
    check_packing,
    file_fault,
    format_of,
    unreadable,
)
from foretwin.world_gen.osm.opl import OPL_OPTIONS

Progress = Callable[[int, int], None]
"""Called with the bytes read and the bytes of the file, from another thread."""
_FEED_BYTES = 1 << 20
BLOCK_BYTES = 8 << 20


class OplStream(contextlib.ExitStack):
    """Yields blocks of whole lines; `header` and `sha256` are there when it has ended."""

    def __init__(self, path: Path, progress: Progress | None = None) -> None:
        super().__init__()
        self.path = path
        self.header = MapHeader(ATTRIBUTION, None)
        self._progress = progress
        self._sha256 = hashlib.sha256()
        with contextlib.ExitStack() as opened:
            try:
                self._file = opened.enter_context(path.open("rb"))
                self._total = path.stat().st_size
                form = format_of(path, self._file.read(HEAD_BYTES))
                check_packing(path, form)
            except OSError as error:
                raise file_fault(path, error) from None
            self._file.seek(0)
            self._complaint = opened.enter_context(tempfile.TemporaryFile())
            script = str(Path(__file__).with_name("opl_filter.py"))
            command = [sys.executable, "-P", script, form, OPL_OPTIONS]
            pipe = subprocess.PIPE
            process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=self._complaint)
            self._process = opened.enter_context(process)
            self._feeder = threading.Thread(target=self._feed, daemon=True)
            self._feeder.start()
            opened.callback(self._feeder.join)
            opened.callback(self._process.kill)
            self.push(opened.pop_all())

    @property
    def sha256(self) -> str:
        """Return the SHA-256 of the whole file, in hex."""
        return self._sha256.hexdigest()

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
        self._feeder.join()
        self._complaint.seek(0)
        answer = self._complaint.read()
        if code != 0:
            reason = answer.decode(errors="replace") or f"decoder ended with {code}"
            raise unreadable(self.path, RuntimeError(reason))
        self.header = MapHeader.of(**json.loads(answer.splitlines()[-1]))

    def _feed(self) -> None:
        target = _pipe(self._process.stdin)
        done = 0
        # A decoder that gives up closes the pipe; its standard error has the reason.
        with contextlib.suppress(BrokenPipeError), target:
            while data := self._file.read(_FEED_BYTES):
                self._sha256.update(data)
                target.write(data)
                done += len(data)
                if self._progress is not None:
                    self._progress(done, self._total)


def _pipe(pipe: IO[bytes] | None) -> IO[bytes]:
    assert pipe is not None, "opened with PIPE"
    return pipe
