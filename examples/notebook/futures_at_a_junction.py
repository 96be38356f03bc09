"""From a map to a picture of futures: `python futures_at_a_junction.py MAP.osm OUT.png`."""

import sys

import matplotlib.pyplot as plt

import foretwin

town = foretwin.open_map(sys.argv[1])
junction = next(one for one in town.intersections if one.kind == "crossing")
world = town.world(junction.id)
way = foretwin.ways_through(world)[0]
car = foretwin.state_on(world, way, before_m=40.0)
futures = foretwin.run_futures(world, way, car, count=32, scenarios=["ltap_od"])
for states, row in zip(futures.states, futures.rows, strict=True):
    plt.plot(states[:, 0], states[:, 1], color="red" if row["collided"] else "green", alpha=0.5)
plt.title(f"{junction.name}\n{town.attribution}")
plt.axis("equal")
plt.savefig(sys.argv[2])
