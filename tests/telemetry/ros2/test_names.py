"""Keys, tokens and attachments of rmw_zenoh and of the bridge."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.telemetry.ros2.attachment import Attachment, pack, unpack
from foretwin.telemetry.ros2.names import (
    Entity,
    bridge_key,
    parse_rmw_key,
    qos_text,
    rmw_any_type_key,
    rmw_key,
    token,
    type_hash,
)
from foretwin.telemetry.ros_messages.parts import types_beside_ros

COVERS = ("foretwin.telemetry.ros2.attachment",)

IMU = "sensor_msgs/msg/Imu"
IMU_HASH = "RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
"""As ROS 2 Jazzy publishes them."""

WORDS = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,8}", fullmatch=True)
TOPICS = st.lists(WORDS, min_size=1, max_size=4).map(lambda words: "/" + "/".join(words))


def test_hashes_are_those_that_ros_publishes() -> None:
    assert type_hash(IMU) == IMU_HASH
    assert type_hash("std_msgs/msg/String") == STRING_HASH


@pytest.mark.parametrize("kind", sorted(types_beside_ros()))
def test_every_type_of_ours_has_a_hash(kind: str) -> None:
    assert type_hash(kind).startswith("RIHS01_")
    assert len(type_hash(kind)) == len(IMU_HASH)


def test_a_key_of_rmw_zenoh() -> None:
    key = rmw_key("/sensing/imu", IMU, domain=0, type_hash=IMU_HASH)
    assert key == "0/sensing/imu/sensor_msgs::msg::dds_::Imu_/" + IMU_HASH
    assert rmw_any_type_key("/sensing/imu", domain=7) == "7/sensing/imu/*/*"


@given(TOPICS, st.integers(0, 232))
def test_keys_are_read_back(topic: str, domain: int) -> None:
    found = parse_rmw_key(rmw_key(topic, IMU, domain=domain, type_hash="TypeHashNotSupported"))
    assert found == (domain, topic, IMU, "TypeHashNotSupported")


def test_a_key_of_the_bridge() -> None:
    assert bridge_key("/sensing/imu") == "sensing/imu"
    assert bridge_key("/sensing/imu", namespace="/bot") == "bot/sensing/imu"


def test_a_token_of_a_subscription() -> None:
    entity = Entity(
        domain=0,
        session="aac3178e",
        node_id=0,
        entity_id=8,
        entity="MS",
        namespace="/",
        node="listener",
        topic="/chatter",
        kind="std_msgs/msg/String",
    )
    text = token(entity)
    assert text == (
        "@ros2_lv/0/aac3178e/0/8/MS/%/%/listener/%chatter/"
        f"std_msgs::msg::dds_::String_/{STRING_HASH}/::,10:,:,:,,"
    )


def test_a_token_of_a_node_in_a_namespace() -> None:
    node = Entity(
        domain=3,
        session="ab12",
        node_id=7,
        entity_id=7,
        entity="NN",
        namespace="/bot/arm",
        node="n",
    )
    assert token(node) == "@ros2_lv/3/ab12/7/7/NN/%/%bot%arm/n"


@pytest.mark.parametrize("key", ["a/b", "0/x/y", "0/x/noType/h", "foretwin/v1/run/r/x"])
def test_other_keys_are_no_topics(key: str) -> None:
    with pytest.raises(ValueError, match=r"key|type|topic"):
        parse_rmw_key(key)


def test_qos_leaves_defaults_empty() -> None:
    assert qos_text(transient_local=False) == "::,10:,:,:,,"
    assert qos_text(transient_local=True) == ":1:,10:,:,:,,"


def labelled(attachment: Attachment) -> bytes:
    """Return the form before rmw_zenoh 0.2.4: each value behind its name and the name's length."""
    values = {
        b"sequence_number": struct.pack("<q", attachment.seq),
        b"source_timestamp": struct.pack("<q", attachment.sent_ns),
        b"source_gid": bytes([16]) + attachment.gid,
    }
    return b"".join(bytes([len(label)]) + label + value for label, value in values.items())


INT64 = st.integers(-(2**63), 2**63 - 1)


@given(st.builds(Attachment, INT64, INT64, st.binary(min_size=16, max_size=16)))
def test_attachments_are_read_in_both_forms(attachment: Attachment) -> None:
    assert len(pack(attachment)) == 33
    assert unpack(pack(attachment)) == attachment
    assert unpack(labelled(attachment)) == attachment


def test_the_older_form_is_whole_or_none() -> None:
    whole = labelled(Attachment(1, 2, bytes(range(16))))
    for wrong in (whole[:-1], whole.replace(b"_gid", b"_git"), whole[1:]):
        with pytest.raises(ValueError, match=f"{len(wrong)} bytes that are no attachment"):
            unpack(wrong)


def test_an_attachment_byte_by_byte() -> None:
    data = pack(Attachment(1, 2, bytes(range(16))))
    assert data.hex() == "0100000000000000" + "0200000000000000" + "10" + bytes(range(16)).hex()


@given(st.binary(max_size=80).filter(lambda data: len(data) != 33))
def test_other_bytes_are_no_attachment(data: bytes) -> None:
    with pytest.raises(ValueError, match="no attachment"):
        unpack(data)
