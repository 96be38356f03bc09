"""One drive: mission, processes, supervision, and the loops that carry messages."""
