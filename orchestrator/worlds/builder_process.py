"""Builds Worlds in the background: `python -m foretwin.orchestrator.worlds.builder_process`."""

from __future__ import annotations

import logging
import time
from pathlib import Path

import numpy as np

from foretwin.contracts.bus import Bus, Mailbox, Request
from foretwin.contracts.errors import one_line
from foretwin.contracts.guard import Refused
from foretwin.contracts.process import ProcessLife, run_process
from foretwin.contracts.setup import BuilderSetup
from foretwin.contracts.simulation import BuildReply
from foretwin.orchestrator.worlds.given_worlds import read_given_worlds
from foretwin.orchestrator.worlds.heights import heights_for
from foretwin.orchestrator.worlds.opening import open_map
from foretwin.orchestrator.worlds.track_store import tracks_for
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.opening import Clip
from foretwin.world_gen.world_store import WorldStore, cached_build

log = logging.getLogger("builder")


def serve_builds(setup: BuilderSetup, bus: Bus, life: ProcessLife) -> None:
    """Read the map once, then answer build requests until the run ends."""
    near = np.array(setup.near_deg, dtype=np.float64).reshape(-1, 2)
    clip = Clip(near, setup.margin_m) if len(near) else None
    opened = open_map(Path(setup.map), clip=clip, tides=False)
    opened = opened.with_roads(setup.added_roads).with_tides(setup.driven_edges)
    osm, graph = opened.osm, opened.graph
    junctions = {j.summary.id: j for j in opened.junctions}
    dem = heights_for(opened, None if setup.dem is None else Path(setup.dem))
    tracks = tracks_for(osm.bounds, setup.tracks)
    index = index_map(osm, graph, junctions.values(), dem=dem, tracks=tracks)
    cache, run_worlds = WorldStore(Path(setup.cache_dir)), WorldStore(Path(setup.worlds_dir))
    folder = setup.given_worlds
    given = {} if folder is None else read_given_worlds(Path(folder))
    mailbox = Mailbox(256)
    bus.serve("build", mailbox, run=setup.run_id, process=setup.process_id)
    life.ready()
    while not life.over:
        request = mailbox.take(0.1)
        if not isinstance(request, Request):
            continue
        try:
            wanted = request.message()
        except Refused as refused:
            if text := life.refusals.take(refused):
                log.warning("%s", text)
            request.refuse(one_line(refused))
            continue
        junction = junctions.get(wanted.intersection_id)
        if junction is None:
            request.refuse(f"the map holds no intersection {wanted.intersection_id!r}")
            continue
        started = time.perf_counter()
        try:
            if wanted.intersection_id in given:
                world, cached = given[wanted.intersection_id], False
                log.info("world %s of %s as given", world.id, wanted.intersection_id)
            else:
                world, cached = cached_build(cache, index, junction, radius_m=wanted.radius_m)
            run_worlds.save(world)
        except Exception as error:
            log.exception("world of %s", wanted.intersection_id)
            request.refuse(f"world of {wanted.intersection_id}: {type(error).__name__}: {error}")
            continue
        request.reply(
            BuildReply(
                intersection_id=wanted.intersection_id,
                world_id=world.id,
                seconds=time.perf_counter() - started,
                cached=cached,
            )
        )


if __name__ == "__main__":
    run_process(BuilderSetup, serve_builds)
