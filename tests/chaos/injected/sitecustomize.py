"""Python imports this as it starts, where its folder is on PYTHONPATH: tells what comes to the
disk, and when, and lets the host's clock be set.

Each fsync adds a line to the file named by FORETWIN_CHAOS_SYNCS_LOG, which lies on another disk:
the drive's may be full. The first of a file gives it a second name, by its inode, in the folder
FORETWIN_CHAOS_SYNCS: whatever is renamed or removed later can be had as it was, for files here only
grow.

The file named by FORETWIN_CHAOS_CLOCK holds by how many nanoseconds the wall clock is off, for all
processes of a drive at the same instant. Zenoh's own clock, which is no Python, stays.
"""

import contextlib
import json
import mmap
import os
import stat
import time

_FOLDER = os.environ.get("FORETWIN_CHAOS_SYNCS", "")
_LOG = os.environ.get("FORETWIN_CHAOS_SYNCS_LOG", "")


def _told(sync):
    def told(descriptor):
        done = sync(descriptor)
        # Whatever goes wrong here is no business of who is watched.
        with contextlib.suppress(OSError):
            known = os.fstat(descriptor)
            if stat.S_ISREG(known.st_mode):
                path = os.readlink(f"/proc/self/fd/{descriptor}")  # noqa: PTH115
                with contextlib.suppress(FileExistsError):
                    os.link(path, f"{_FOLDER}/{known.st_ino}")
                line = {"ns": time.monotonic_ns(), "path": path, "inode": known.st_ino,
                        "bytes": known.st_size}  # fmt: skip
                log = os.open(_LOG, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
                os.write(log, json.dumps(line).encode() + b"\n")
                os.close(log)
        return done

    return told


if _FOLDER:
    os.fsync, os.fdatasync = _told(os.fsync), _told(os.fdatasync)

if os.path.isfile(_CLOCK := os.environ.get("FORETWIN_CHAOS_CLOCK", "")):  # noqa: PTH113
    with open(_CLOCK, "rb") as _file:  # noqa: PTH123
        _offset = memoryview(mmap.mmap(_file.fileno(), 8, prot=mmap.PROT_READ)).cast("q")
    _time_ns = time.time_ns
    time.time_ns = lambda: _time_ns() + _offset[0]
    time.time = lambda: time.time_ns() * 1e-9
