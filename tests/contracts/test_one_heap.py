"""One heap for all threads, as glibc counts them, and what of it is given back."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

COUNT_HEAPS = """
import ctypes, sys, threading
from foretwin.contracts.one_heap import share_one_heap

libc = ctypes.CDLL(None)
libc.malloc.restype = libc.fopen.restype = ctypes.c_void_p
if "one" in sys.argv:
    share_one_heap()
all_there = threading.Barrier(4)

def work():
    libc.malloc(1000)
    all_there.wait()

threads = [threading.Thread(target=work) for _ in range(4)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
libc.malloc_info(0, ctypes.c_void_p(libc.fopen(b"/dev/stdout", b"w")))
libc.fflush(None)
"""

pytestmark = pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="glibc has these heaps")


def heaps(*arguments: str) -> int:
    command = [sys.executable, "-c", COUNT_HEAPS, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return done.stdout.count("<heap nr=")


def test_threads_share_the_heap_that_there_is() -> None:
    assert heaps("one") == 1
    assert heaps() > 1, "what it is for"


ARROWS = """
import sys
if "before" in sys.argv:
    import pyarrow
    pyarrow.array([1])
from foretwin.contracts.one_heap import share_one_heap
share_one_heap()
import pyarrow
print(pyarrow.default_memory_pool().backend_name)
"""


@pytest.mark.parametrize("imported", ["before", "after"])
def test_arrow_takes_from_that_heap(imported: str) -> None:
    command = [sys.executable, "-c", ARROWS, imported]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "system"


HOLES = """
import ctypes
from foretwin.contracts.one_heap import GIVE_BACK_EVERY_S, FreeMemory

libc = ctypes.CDLL(None)
libc.malloc.restype = ctypes.c_void_p
libc.memset.argtypes = ctypes.c_void_p, ctypes.c_int, ctypes.c_size_t
libc.free.argtypes = (ctypes.c_void_p,)

def held_mb():
    return int(open("/proc/self/statm").read().split()[1]) * 4096 / 1e6

parts = [libc.malloc(100_000) for _ in range(1000)]
for part in parts:
    libc.memset(part, 1, 100_000)
for part in parts[::2]:
    libc.free(part)  # between two that stay
before_mb, free = held_mb(), FreeMemory(7.0)
assert not free.look(7.0 + GIVE_BACK_EVERY_S - 0.1)
assert held_mb() > before_mb - 5.0
assert free.look(7.0 + GIVE_BACK_EVERY_S)
print(before_mb - held_mb())
assert not free.look(8.0 + GIVE_BACK_EVERY_S), "it is time again after the whole pause"
"""


def test_what_lies_free_between_what_is_used_is_given_back() -> None:
    command = [sys.executable, "-c", HOLES]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert 40.0 < float(done.stdout) < 60.0
