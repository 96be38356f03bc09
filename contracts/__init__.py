"""What the rooms of foretwin say to each other: types, frames, keys, codec, bus.

No simulation and no map logic lives here; every other package may import this one.
"""
