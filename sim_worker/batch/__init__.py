"""Many cars stepped together: the batch simulation, collisions, accidents."""
