"""Index a map in a process of its own and print seconds, peak memory and what is in it as JSON.

python -m tests.world_gen.measure_index MAP FOLDER [BATCH_BYTES BLOCK_BYTES]
"""

from __future__ import annotations

import json
import resource
import sys
import time
from pathlib import Path

from world_gen import build_map_store, opl_stream
from world_gen.map_store import MapStore


def main() -> None:
    if len(sys.argv) > 3:
        build_map_store.BATCH_BYTES, opl_stream.BLOCK_BYTES = (int(n) for n in sys.argv[3:5])
    begin_s = time.perf_counter()
    store = MapStore.open(Path(sys.argv[1]), Path(sys.argv[2]))
    taken_s = time.perf_counter() - begin_s
    own, decoder = (
        resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    report = {
        "seconds": taken_s,
        "cpu_seconds": sum(u.ru_utime + u.ru_stime for u in (own, decoder)),
        "peak_bytes": own.ru_maxrss * 1024,
        "decoder_peak_bytes": decoder.ru_maxrss * 1024,
        "index_bytes": store.path.stat().st_size,
        "ways": store.meta.ways,
        "nodes": store.meta.nodes,
    }
    print(json.dumps(report))


if __name__ == "__main__":
    main()
