"""Our node as ROS sees it: its liveliness tokens, and its samples with key and attachment."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Iterable

import msgspec

from foretwin.contracts.foreign_bus import ForeignBus
from foretwin.telemetry.ros2 import names
from foretwin.telemetry.ros2.attachment import Attachment, pack
from foretwin.telemetry.ros2.mapping import Mapping
from foretwin.telemetry.ros2.rows import InRow, OutRow

NODE = "foretwin"


class RosSender:
    """Sends CDR bytes in the mapping's dialect; `wall_ns` stamps the attachments."""

    def __init__(
        self, mapping: Mapping, foreign: ForeignBus, *, wall_ns: Callable[[], int]
    ) -> None:
        self._mapping, self._foreign, self._wall_ns = mapping, foreign, wall_ns
        self._session = foreign.session_id
        self.sent: Counter[str] = Counter()
        """Messages sent by topic."""

    def announce(self, rows: Iterable[InRow | OutRow]) -> None:
        """Declare the tokens of node and ends, so that ROS lists them; the bridge needs none."""
        if self._mapping.dialect == "ros2dds":
            return
        node = names.Entity(
            domain=self._mapping.domain,
            session=self._session,
            node_id=0,
            entity_id=0,
            entity="NN",
            namespace="/",
            node=NODE,
        )
        self._foreign.declare_alive(names.token(node))
        for number, row in enumerate(rows, 1):
            entity: names.EntityKind = "MS" if isinstance(row, InRow) else "MP"
            end = msgspec.structs.replace(
                node,
                entity_id=number,
                entity=entity,
                topic=row.topic,
                kind=row.type,
                transient_local=isinstance(row, InRow) and row.is_latched,
            )
            self._foreign.declare_alive(names.token(end))

    def put(self, row: OutRow, payload: bytes) -> None:
        """Send one message."""
        mapping = self._mapping
        self.sent[row.topic] += 1
        if mapping.dialect == "ros2dds":
            self._foreign.put(names.bridge_key(row.topic, namespace=mapping.namespace), payload)
            return
        hash_text = names.type_hash(row.type)
        key = names.rmw_key(row.topic, row.type, domain=mapping.domain, type_hash=hash_text)
        gid = hashlib.blake2b(f"{self._session}{row.topic}".encode(), digest_size=16).digest()
        attached = Attachment(self.sent[row.topic], self._wall_ns(), gid)
        self._foreign.put(key, payload, pack(attached))
