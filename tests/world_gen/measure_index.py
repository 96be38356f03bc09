"""Index a map in a process of its own and print seconds, peak memory and what is in it as JSON.

python -m tests.world_gen.measure_index MAP FOLDER [SHRINK]

SHRINK divides everything that is taken in one go, so that small maps show what large ones do.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from pathlib import Path

from foretwin.world_gen.osm import build_map_store, node_spool, opl_stream
from foretwin.world_gen.osm.map_store import MapStore


def main() -> None:
    if len(sys.argv) not in (3, 4):
        raise SystemExit("usage: python -m tests.world_gen.measure_index MAP FOLDER [SHRINK]")
    if len(sys.argv) > 3:
        shrink = int(sys.argv[3])
        build_map_store.BATCH_BYTES //= shrink
        build_map_store.LINES_BYTES //= shrink
        opl_stream.BLOCK_BYTES //= shrink
        node_spool.WINDOW //= shrink
    begin_s = time.perf_counter()
    store = MapStore.open(Path(sys.argv[1]), Path(sys.argv[2]))
    taken_s = time.perf_counter() - begin_s
    own, decoder = (
        resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    report = {
        "seconds": taken_s,
        "cpu_seconds": sum(u.ru_utime + u.ru_stime for u in (own, decoder)),
        "peak_bytes": _peak_bytes(),
        "decoder_peak_bytes": decoder.ru_maxrss * 1024,
        "index_bytes": store.path.stat().st_size,
        "ways": store.meta.ways,
        "nodes": store.meta.nodes,
    }
    print(json.dumps(report))


def _peak_bytes() -> int:
    """Return this program's own peak; what getrusage says begins at that of who started it."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.partition("VmHWM:")[2].split()[0]) * 1024


if __name__ == "__main__":
    main()
