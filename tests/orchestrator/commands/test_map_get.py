"""A map comes whole and checked from the endpoint that the configuration names, or not at all."""

from __future__ import annotations

import gzip
import threading
import urllib.parse
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import NamedTuple

import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.commands.map_get import area_filter, get_map
from foretwin.world_gen.osm.read_osm import read_map

COVERS = (
    "foretwin.orchestrator.worlds.overpass",
    "foretwin.orchestrator.worlds.overpass_query",
)

BOX = "8.0,53.0,8.1,53.1"
MAP = b"""<?xml version="1.0"?><osm version="0.6" generator="Overpass API">
<node id="1" lat="53.01" lon="8.01"/><node id="2" lat="53.02" lon="8.02"/>
<way id="10"><nd ref="1"/><nd ref="2"/><tag k="highway" v="residential"/></way>
</osm>
"""
REMARK = MAP.replace(b"</osm>", b"<remark> runtime error: Query timed out in query </remark></osm>")


class Reply(NamedTuple):
    status: int
    body: bytes = b""
    headers: dict[str, str] = {}  # noqa: RUF012
    announced: int | None = None
    """The Content-Length that is sent, where it is not the true one."""


class Endpoint:
    """A server that gives the replies in order, the last one for ever, and keeps what it heard."""

    def __init__(self, replies: list[Reply]) -> None:
        self.replies = replies
        self.queries: list[str] = []
        self.agents: list[str] = []
        endpoint = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                form = self.rfile.read(int(self.headers["Content-Length"])).decode()
                endpoint.queries.append(urllib.parse.parse_qs(form)["data"][0])
                endpoint.agents.append(self.headers["User-Agent"])
                reply = endpoint.replies[min(len(endpoint.queries), len(endpoint.replies)) - 1]
                self.send_response(reply.status)
                size = len(reply.body) if reply.announced is None else reply.announced
                for key, value in (reply.headers | {"Content-Length": str(size)}).items():
                    self.send_header(key, value)
                self.end_headers()
                self.wfile.write(reply.body)

            def log_request(self, code: object = "", size: object = "") -> None:
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.thread = threading.Thread(target=self.server.serve_forever, args=(0.01,))
        self.thread.start()

    def config(self, folder: Path, **settings: object) -> Path:
        port = self.server.server_address[1]
        lines = [f'endpoint = "http://127.0.0.1:{port}/api"', 'user_agent = "keeper@example.org"']
        lines += [f"{key} = {value}" for key, value in ({"back_off_s": 0.01} | settings).items()]
        path = folder / "overpass.toml"
        path.write_text("[overpass]\n" + "\n".join(lines), encoding="utf-8")
        return path

    def close(self) -> None:
        self.server.shutdown()
        self.server.server_close()
        self.thread.join()


@pytest.fixture
def endpoint() -> Iterator[Endpoint]:
    server = Endpoint([Reply(200, MAP)])
    yield server
    server.close()


@pytest.fixture
def out(tmp_path: Path) -> Path:
    folder = tmp_path / "maps"
    folder.mkdir()
    return folder / "town.osm"


def test_a_box_becomes_a_map(endpoint: Endpoint, out: Path, tmp_path: Path) -> None:
    get_map(BOX, out=out, config=endpoint.config(tmp_path))
    assert list(read_map(out).ways) == [10]
    (query,) = endpoint.queries
    assert 'way["highway"](53.0000000,8.0000000,53.1000000,8.1000000)' in query
    assert 'way["amenity"="shelter"](53.0000000' in query
    for filters in ('["natural"="tree"]', '["highway"="bus_stop"]["shelter"]'):
        assert f"node{filters}(53.0000000" in query
    assert query.startswith("[out:xml][timeout:180]")
    (agent,) = endpoint.agents
    assert agent.startswith("foretwin/")
    assert "keeper@example.org" in agent
    assert [path.name for path in out.parent.iterdir()] == ["town.osm"]


def test_packed_where_the_name_says_so(endpoint: Endpoint, out: Path, tmp_path: Path) -> None:
    endpoint.replies = [Reply(200, gzip.compress(MAP), {"Content-Encoding": "gzip"})]
    packed = out.with_name("town.osm.gz")
    get_map(BOX, out=packed, config=endpoint.config(tmp_path))
    assert gzip.decompress(packed.read_bytes()) == MAP


def test_a_route_is_asked_for_with_its_margin(
    endpoint: Endpoint, out: Path, tmp_path: Path
) -> None:
    route = tmp_path / "way.gpx"
    points = "".join(f'<trkpt lat="53.0{i}" lon="8.0{i}"/>' for i in range(5))
    route.write_text(f"<gpx><trk><trkseg>{points}</trkseg></trk></gpx>", encoding="utf-8")
    get_map(str(route), out=out, config=endpoint.config(tmp_path, margin_m=250))
    # A straight line needs two points alone, with 20 m for the bends that were taken out.
    assert "(around:270,53.000000,8.000000,53.040000,8.040000)" in endpoint.queries[0]


@pytest.mark.parametrize("header", ["number", "date"])
def test_waits_as_long_as_it_is_told(
    endpoint: Endpoint, out: Path, tmp_path: Path, header: str
) -> None:
    passed = format_datetime(datetime.now(UTC) - timedelta(seconds=5), usegmt=True)
    after = {"Retry-After": "0" if header == "number" else passed}
    endpoint.replies = [Reply(429, headers=after), Reply(200, MAP)]
    # The own back-off would outlast the test: only the header lets it end in time.
    get_map(BOX, out=out, config=endpoint.config(tmp_path, back_off_s=600, max_wait_s=600))
    assert len(endpoint.queries) == 2
    assert out.exists()


def test_gives_up_where_the_wait_is_too_long(endpoint: Endpoint, out: Path, tmp_path: Path) -> None:
    endpoint.replies = [Reply(429, headers={"Retry-After": "4000"})]
    with pytest.raises(UserError, match="asks to wait 4000 s"):
        get_map(BOX, out=out, config=endpoint.config(tmp_path))


@pytest.mark.parametrize(
    ("reply", "complaint", "asked"),
    [
        (Reply(504), "answered 504 Gateway Timeout; gave up after 3 attempts", 3),
        (Reply(400, b"bad query"), "answered 400", 1),
        (Reply(200, MAP[:-20]), "breaks off before its end; gave up after 3", 3),
        (Reply(200, MAP[:150], announced=len(MAP)), "gave up after 3 attempts", 3),
        (Reply(200, REMARK), "not complete: runtime error: Query timed out", 1),
        (Reply(200, b"<html>busy</html>"), "no OSM XML: '<html>busy</html>'", 1),
        (Reply(200, MAP.replace(b'lat="53.01"', b"lat=53")), "not a readable OSM file", 1),
        (Reply(200, b'<osm version="0.6"></osm>'), "holds no roads and no buildings", 1),
        (Reply(200, MAP, announced=10**9), "larger than 1000 bytes", 1),
        (Reply(200, MAP.replace(b"\n", b"\n" * 500)), "larger than 1000 bytes", 1),
        (Reply(200, gzip.compress(bytes(10**6)), {"Content-Encoding": "gzip"}), "larger than", 1),
    ],
)
def test_what_is_no_whole_map_is_refused_and_nothing_written(
    endpoint: Endpoint, out: Path, tmp_path: Path, reply: Reply, complaint: str, asked: int
) -> None:
    endpoint.replies = [reply]
    with pytest.raises(UserError, match=complaint) as caught:
        get_map(BOX, out=out, config=endpoint.config(tmp_path, retries=2, max_bytes=1000))
    assert "\n" not in str(caught.value)
    assert len(endpoint.queries) == asked
    assert not list(out.parent.iterdir())


def test_a_map_that_is_there_stays_until_the_new_one_is_whole(
    endpoint: Endpoint, out: Path, tmp_path: Path
) -> None:
    out.write_bytes(b"the old one")
    endpoint.replies = [Reply(200, REMARK)]
    with pytest.raises(UserError):
        get_map(BOX, out=out, config=endpoint.config(tmp_path))
    assert out.read_bytes() == b"the old one"


def test_nobody_is_asked_without_a_configuration(out: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"--config FILE, a table \[overpass\] with endpoint"):
        get_map(BOX, out=out, config=None)
    empty = tmp_path / "foretwin.toml"
    empty.write_text('map = "town.osm"\n', encoding="utf-8")
    with pytest.raises(UserError, match=r"lacks a table \[overpass\]"):
        get_map(BOX, out=out, config=empty)
    empty.write_text('[overpass]\nendpoint = "https://example.org"\n', encoding="utf-8")
    with pytest.raises(UserError, match="user_agent"):
        get_map(BOX, out=out, config=empty)


def test_a_server_that_is_not_there(out: Path, tmp_path: Path) -> None:
    gone = Endpoint([])
    config = gone.config(tmp_path, retries=1)
    gone.close()
    with pytest.raises(UserError, match="gave up after 2 attempts"):
        get_map(BOX, out=out, config=config)


@pytest.mark.parametrize(
    ("area", "complaint"),
    [
        ("1,2,3", "four numbers"),
        ("8,53,9,52", "south below north"),
        ("8,53,8,54", "no width"),
        ("200,53,8,54", "within"),
    ],
)
def test_what_is_no_box_says_so(area: str, complaint: str) -> None:
    with pytest.raises(UserError, match=complaint):
        area_filter(area, margin_m=100.0)
