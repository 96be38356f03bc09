"""What a World is called: by a hash of what is in it, so that who has its bytes can check them."""

from __future__ import annotations

import hashlib

import msgspec

from foretwin.contracts.codec import SchemaMismatch, content_parts, decode
from foretwin.contracts.world import World

_ID_DIGITS = 16


def with_id(world: World) -> World:
    """Return the World with the id that its content has: 16 hex digits of a SHA-256."""
    nameless = msgspec.structs.replace(world, id="")
    digest = hashlib.sha256()
    for part in content_parts(nameless):
        digest.update(part)
    return msgspec.structs.replace(nameless, id=digest.hexdigest()[:_ID_DIGITS])


def checked_world(data: bytes, world_id: str, *, where: str) -> World:
    """Return the World in the bytes of its file; raises SchemaMismatch, naming `where`, for bytes
    that are none, and for those of another World than `world_id`."""
    world = with_id(decode(data, World, where=where).message)
    if world.id != world_id:
        raise SchemaMismatch(f"{where}: holds World {world.id} instead of {world_id}")
    return world
