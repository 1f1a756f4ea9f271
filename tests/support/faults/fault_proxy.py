"""A TCP proxy between browser and server that causes network faults, the same ones for the same seed.

What TCP does to loss is a stall: bytes are late, all that come after them too, none is missing. So loss is modelled as
a wait of a retransmission time that doubles, and latency never reorders.
"""

import asyncio
import random
import socket
import struct
from contextlib import suppress
from dataclasses import dataclass

_CHUNK_BYTES = 4096
_MAX_WAITING = 16  # chunks a direction holds before it stops reading, as a full pipe would
_RETRANSMIT_MS = 200.0


@dataclass(frozen=True)
class Weather:
    """The faults that apply to every chunk."""

    latency_ms: float = 0.0
    jitter_ms: float = 0.0  # up to so much more or less
    loss: float = 0.0  # share of chunks that wait for a retransmission
    bytes_per_s: float = 0.0  # 0: as many as come


class Way:
    """One direction of one connection: chunks are forwarded later, in order, unless the direction is frozen."""

    def __init__(self, proxy: "FaultProxy", reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._proxy, self._reader, self._writer = proxy, reader, writer
        self._waiting: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue(_MAX_WAITING)
        self.gate = asyncio.Event()
        self.gate.set()

    async def carry(self) -> None:
        """Until either side closes."""
        await asyncio.gather(self._take(), self._give())

    async def _take(self) -> None:
        loop, due = asyncio.get_running_loop(), 0.0
        while data := await self._reader.read(_CHUNK_BYTES):
            due = max(due, loop.time() + self._proxy.delay_s(len(data)))
            await self._waiting.put((due, data))
        await self._waiting.put((due, b""))

    async def _give(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            due, data = await self._waiting.get()
            await asyncio.sleep(due - loop.time())
            await self.gate.wait()
            if not data:
                if self._writer.can_write_eof():
                    self._writer.write_eof()
                return
            if not self._proxy.deaf:
                self._writer.write(data)
                await self._writer.drain()


class FaultProxy:
    """`async with FaultProxy(port, seed) as proxy:` listens at `proxy.port` and passes on to 127.0.0.1:`port`.

    `weather` may be changed at any time. `refusing`: new connections are closed at once. `deaf`: bytes vanish, nobody
    is told (a half-open connection).
    """

    def __init__(self, port: int, seed: int = 0, weather: Weather | None = None) -> None:
        self.target, self.weather = port, weather or Weather()
        self.refusing = self.deaf = False
        self._chance = random.Random(seed)
        self._lines: dict[asyncio.Task[None], tuple[asyncio.StreamWriter, asyncio.StreamWriter, Way, Way]] = {}
        self._server: asyncio.Server | None = None
        self.port = 0

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def __len__(self) -> int:
        return len(self._lines)

    async def __aenter__(self) -> "FaultProxy":
        self._server = await asyncio.start_server(self._accept, "127.0.0.1", 0)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *_: object) -> None:
        assert self._server is not None
        self._server.close()
        lines = list(self._lines)
        for line in lines:
            line.cancel()
        await asyncio.gather(*lines, return_exceptions=True)

    def delay_s(self, size: int) -> float:
        """How late the next chunk is."""
        weather = self.weather
        delay_ms = weather.latency_ms + self._chance.uniform(-weather.jitter_ms, weather.jitter_ms)
        wait_ms = _RETRANSMIT_MS
        while weather.loss and self._chance.random() < weather.loss:
            delay_ms, wait_ms = delay_ms + wait_ms, 2 * wait_ms
        rate_s = size / weather.bytes_per_s if weather.bytes_per_s else 0.0
        return max(0.0, delay_ms / 1000) + rate_s

    def freeze(self, up: bool = True, down: bool = True) -> None:
        """Nothing passes in these directions until `thaw`; the connections stay open."""
        for *_, upward, downward in self._lines.values():
            for way, stops in ((upward, up), (downward, down)):
                if stops:
                    way.gate.clear()

    def thaw(self) -> None:
        for *_, upward, downward in self._lines.values():
            upward.gate.set()
            downward.gate.set()

    def reset(self) -> int:
        """Break every connection with an RST to both sides; how many."""
        broken = list(self._lines.items())
        for line, (near, far, *_) in broken:
            for writer in (near, far):
                raw = writer.get_extra_info("socket")
                with suppress(OSError):  # it may be closed already
                    raw.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                writer.transport.abort()
            line.cancel()
        return len(broken)

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self.refusing:
            writer.transport.abort()
            return
        try:
            far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self.target)
        except OSError:
            writer.transport.abort()
            return
        line = asyncio.current_task()
        assert line is not None
        upward, downward = Way(self, reader, far_writer), Way(self, far_reader, writer)
        self._lines[line] = (writer, far_writer, upward, downward)
        try:
            with suppress(OSError):
                await asyncio.gather(upward.carry(), downward.carry())
        except asyncio.CancelledError:
            pass  # the proxy ends, or the line was reset
        finally:
            del self._lines[line]
            for one in (writer, far_writer):
                one.close()
