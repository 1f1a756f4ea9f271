"""What attackers send (rows 18 to 20): garbage, too much, nothing at all. Other games continue."""

import asyncio
import os
import random
import socket
import struct
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

from server.play import messages
from tests.support.faults.fault_scenario import FaultResult, rounded
from tests.support.faults.group import LONG_STUDY, ClientGroup
from tests.support.faults.invariants import Holdings, held_against, lateness_ms, p99
from tests.support.faults.recording_client import RecordingClient
from tests.support.live_server import LiveServer
from tests.support.real_server import RealServer

TEMPLATES = (
    b'{"type":"hello","protocol":1,"tab":"tab-0001"}',
    b'{"type":"input","seq":17,"held":2,"tap":null,"client_ms":48213.5}',
    b'{"type":"away","reason":"blur"}',
    b'{"type":"pong","id":12}',
    b'{"type":"trouble","text":"x"}',
    b'{"type":"ready"}',
)
PIECES = (
    b"{",
    b"}",
    b"[",
    b'"',
    b"\\u0000",
    b"1e999",
    b"NaN",
    b"-",
    b"\xff",
    b"\xc3(",
    b"null",
    b"9" * 40,
    b"[" * 600,
    b",",
)
_CLOSE = 0x8  # opcode


def mutant(chance: random.Random) -> bytes:
    """A frame near enough to a message to get far into the decoder."""
    frame = bytearray(chance.choice(TEMPLATES))
    for _ in range(chance.randrange(0, 6)):
        at = chance.randrange(len(frame) + 1)
        match chance.randrange(4):
            case 0:
                frame[at:at] = chance.choice(PIECES)
            case 1:
                del frame[at : at + chance.randrange(1, 8)]
            case 2 if at < len(frame):
                frame[at] = chance.randrange(256)
            case _:
                frame[at:at] = frame[at : at + chance.randrange(1, 30)]
    return bytes(frame[: 2 * messages.MAX_FRAME_BYTES])


def decoder(tries: int, seed: int = 0) -> FaultResult:
    """Row 18: the decoder gives a message or says BadMessage, and grows by nothing."""
    chance = random.Random(seed)
    accepted = refused = 0
    for number in range(tries):
        if number == tries // 10:
            before = Holdings.of(os.getpid())
        try:
            messages.decode(mutant(chance))
            accepted += 1
        except messages.BadMessage:
            refused += 1
    growth = Holdings.of(os.getpid()).rss_kib - before.rss_kib
    figure = {"accepted": accepted, "refused": refused, "rss_growth_kib": growth, "seed": seed}
    return FaultResult(
        18, "malformed messages at the decoder", tries, growth < 4096 and accepted + refused == tries, figure
    )


def client_frame(text: bytes) -> bytes:
    """A text message as a client sends it, masked with zeros."""
    return struct.pack(">BBH", 0x81, 0x80 | 126, len(text)) + bytes(4) + text


def raw_frame(chance: random.Random) -> bytes:
    """A websocket frame, right or wrong in every field: opcode, mask, length, reserved bits."""
    payload = mutant(chance)[: chance.choice((0, 20, 120, 1500))]
    first = chance.choice((0x81, 0x81, 0x81, 0x82, 0x80, 0x01, 0x88, 0x89, 0x8A, 0x83, 0xF1, chance.randrange(256)))
    masked = chance.random() < 0.9
    length = len(payload) if chance.random() < 0.9 else chance.randrange(1 << 16)
    head = bytes([first, (0x80 if masked else 0) | min(length, 126)])
    head += struct.pack(">H", length) if length >= 126 else b""
    key = bytes(4) if masked else b""
    return head + key + payload


async def frames(folder: Path, tries: int, seed: int = 0) -> FaultResult:
    """Row 18: raw frames on real game sockets of one participant, while two others play."""
    chance = random.Random(seed)
    sent = 0
    with LiveServer(folder, study=LONG_STUDY, speed=4.0) as live:
        async with ClientGroup(live.url, 2) as others:
            bad = RecordingClient(live.url, "short", 77)
            await bad.to_the_game()
            before = Holdings.of(os.getpid())
            while sent < tries:
                sent += await _throw(bad, chance, min(40, tries - sent))
            began = time.monotonic()
            await others.moving(began)
            playing = asyncio.create_task(bad.game().play())  # and even this one may come back
            while bad.log.first("tick", began) is None and time.monotonic() < began + 20:
                await asyncio.sleep(0.02)
            came_back = bad.log.first("tick", began) is not None
            playing.cancel()
            await asyncio.gather(playing, return_exceptions=True)
            growth = Holdings.of(os.getpid()).rss_kib - before.rss_kib
            await bad.close()
        found = held_against(live.database, others.clients)
        found.people.clear()  # the one who throws is a third
    figure = found.figures() | {"came_back": int(came_back), "rss_growth_kib": growth, "seed": seed}
    return FaultResult(18, "malformed frames on a socket", sent, found.ok and came_back, figure)


async def _throw(bad: RecordingClient, chance: random.Random, most: int) -> int:
    """Open a socket by hand and throw frames until it is closed; how many went out."""
    sent = 0
    async with _by_hand(bad) as (reader, writer):
        while sent < most and not reader.at_eof():
            writer.write(raw_frame(chance))
            await writer.drain()
            sent += 1
    return max(1, sent)


@asynccontextmanager
async def _by_hand(bad: RecordingClient) -> AsyncIterator[tuple[asyncio.StreamReader, asyncio.StreamWriter]]:
    """A game socket without a library that would keep to the rules; a line that breaks ends the block."""
    host, port = bad.base.removeprefix("http://").split(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    lines = [f"GET /s/short/socket HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade"]
    lines += [
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13",
        f"Cookie: {bad.cookie}\r\n\r\n",
    ]
    writer.write("\r\n".join(lines).encode())
    try:
        with suppress(OSError, asyncio.IncompleteReadError):
            head = await reader.readuntil(b"\r\n\r\n")
            assert head.startswith(b"HTTP/1.1 101"), head
            yield reader, writer
    finally:
        writer.transport.abort()


async def flood(folder: Path, seconds: float, goal_ms: float | None = None) -> FaultResult:
    """Row 19: one participant sends as fast as the line takes it, over and over, and continues after being told that it
    is closed; it is soon told so, and its neighbours lose nothing and (`goal_ms`) are on time."""
    told: list[float] = []
    with RealServer(folder, speed=1.0, study=LONG_STUDY) as server:
        async with ClientGroup(server.url, 3, idle=0.8) as others:
            bad = RecordingClient(server.url, "short", 78)
            await bad.to_the_game()
            await asyncio.sleep(seconds)
            calm, since_ms = lateness_ms(server.database), time.time() * 1000
            before, ends = Holdings.of(server.pid), time.monotonic() + seconds
            while time.monotonic() < ends:
                told.append(await _flood_once(bad, insist_s=1.0))
                await asyncio.sleep(0.3)
            growth = Holdings.of(server.pid).rss_kib - before.rss_kib
            loud = lateness_ms(server.database, since_ms=since_ms)
            await others.moving(time.monotonic())
            await bad.close()
        found = held_against(server.database, others.clients)
        found.people.clear()  # the one who floods is one more
    shift = p99(loud) - p99(calm)
    figure = found.figures() | {"closed_after_most_s": rounded(max(told)), "rss_growth_kib": growth}
    figure |= {"shift_p99_ms": rounded(shift), "p99_ms_before": rounded(p99(calm))}
    passed = found.ok and max(told) < 2.0 and growth < 8 * 1024 and (goal_ms is None or shift < goal_ms)
    return FaultResult(19, "flood of one participant", len(told), passed, figure)


_FLOOD = b"".join(
    client_frame(b'{"type":"input","seq":%d,"held":null,"tap":2,"client_ms":1}' % seq) for seq in range(1000)
)


async def _flood_once(bad: RecordingClient, insist_s: float) -> float:
    """Seconds from the first message to the close frame, after which the flood continues for a while."""
    async with _by_hand(bad) as (reader, writer):
        began = time.monotonic()
        told = asyncio.create_task(_closed_at(reader))
        pouring = asyncio.create_task(_pour(writer))
        closed = await asyncio.wait_for(told, 20)
        await asyncio.wait({pouring}, timeout=insist_s)
        pouring.cancel()
        await asyncio.gather(pouring, return_exceptions=True)
        return closed - began
    raise AssertionError("the line broke without a word")


async def _pour(writer: asyncio.StreamWriter) -> None:
    writer.write(client_frame(TEMPLATES[0]))
    while True:
        writer.write(_FLOOD)
        await writer.drain()


async def _closed_at(reader: asyncio.StreamReader) -> float:
    """When the server's close frame came; it must name abuse."""
    while True:
        first, length = await reader.readexactly(2)
        if length >= 126:
            length = int.from_bytes(await reader.readexactly(2 if length == 126 else 8))
        payload = await reader.readexactly(length)
        if first & 0x0F == _CLOSE:
            assert int.from_bytes(payload[:2]) == 1008, payload
            return time.monotonic()


async def idle_connections(folder: Path, connections: int, words: bytes) -> FaultResult:
    """Row 20: many connections that say nothing, or half a request; games are safe and a new page still opens."""
    held: list[socket.socket] = []
    with LiveServer(folder, study=LONG_STUDY, speed=1.0) as live:
        async with ClientGroup(live.url, 2, idle=0.9) as group:
            before = group.since("closed", 0.0)
            for _ in range(connections):
                one = socket.create_connection(("127.0.0.1", live.port))
                one.sendall(words)
                held.append(one)
                if len(held) % 100 == 0:
                    await asyncio.sleep(0.01)
            began = time.monotonic()
            newcomer = RecordingClient(live.url, "short", 79)
            await newcomer.to_the_game()
            opened = time.monotonic() - began
            await newcomer.close()
            await group.moving(began)
            left = await _left(live, 2 + 2)
            lost = len(group.since("closed", 0.0)) - len(before)
    for one in held:
        one.close()
    figure = {"games_lost": lost, "page_opened_s": rounded(opened), "connections_left": left}
    fault = "connections that say nothing" if not words else "connections that never finish a request"
    return FaultResult(20, fault, connections, not lost and not left, figure)


async def _left(live: LiveServer, wanted: int) -> int:
    """How many connections stay open beyond those of the games, after a while."""
    state: Any = live._server.server_state
    ends = time.monotonic() + 20
    while len(state.connections) > wanted and time.monotonic() < ends:
        await asyncio.sleep(0.1)
    return max(0, len(state.connections) - wanted)


async def neighbours(folder: Path, seconds: float, games: int, goal_ms: float | None = None) -> FaultResult:
    """I5: while somebody floods, throws garbage and breaks connections, the other games' ticks are on time."""
    with RealServer(folder, speed=1.0, study=LONG_STUDY) as server:
        bad = RecordingClient(server.url, "short", 80)
        await bad.to_the_game()
        async with ClientGroup(server.url, games, idle=0.9) as group:
            await asyncio.sleep(seconds)
            calm, since_ms = lateness_ms(server.database), time.time() * 1000
            ends, chance = time.monotonic() + seconds, random.Random(19)
            while time.monotonic() < ends:
                await _throw(bad, chance, 40)
                await _flood_once(bad, insist_s=0.5)
                await asyncio.sleep(0.5)
            loud = lateness_ms(server.database, since_ms=since_ms)
        await bad.close()
        found = held_against(server.database, group.clients)
        found.people.clear()  # the one who does harm is one more
    shift = p99(loud) - p99(calm)
    figure = found.figures() | {"shift_p99_ms": rounded(shift), "p99_ms_before": rounded(p99(calm))}
    passed = found.ok and (goal_ms is None or shift < goal_ms)
    return FaultResult(19, "abuse next to other games", games, passed, figure)
