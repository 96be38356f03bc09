"""One heap for all threads, as glibc counts them."""

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
