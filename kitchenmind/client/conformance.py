"""Checks of a server against docs/reference/protocol.md, each on real connections: what `kitchenmind conformance` runs.

A check raises `Unmet` with what was seen instead; its docstring is the sentence that is printed.
"""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Final

import httpx
import msgspec
import numpy as np
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidStatus

from kitchenmind.client.checked_sockets import CheckedSockets, Unmet, hello, name_of, require, send
from kitchenmind.client.game_client import ProtocolError
from kitchenmind.client.seen_kitchen import SeenKitchen, compile_rules
from kitchenmind.client.study_client import ClientFailed
from overcooked.constants import PLAYERS, STAY
from overcooked.layout import LayoutError
from server.play import messages
from server.play.close_codes import CloseCode

_TIMESTEPS: Final = 8  # that are compared with the rules
_APPLIED_WITHIN: Final = 25  # timesteps, on a slow line
_MAX_PAGES: Final = 20
_CANNOT_CONNECT: Final = (OSError, TimeoutError, InvalidHandshake)


@dataclass(frozen=True)
class Finding:
    """The result of one check. `reason`: why it failed."""

    name: str
    passed: bool
    reason: str = ""


class Conformance(CheckedSockets):
    """The checks, in their order, with one simulated participant of a study."""

    async def run(self, report: Callable[[Finding], None] | None = None) -> list[Finding]:
        """Run every check; `report` is called with each finding at once. Later checks also run if one fails."""
        compile_rules()
        findings = []
        async with self.client:
            for check in self._checks():
                findings.append(await _finding(check))
                if report is not None:
                    report(findings[-1])
        return findings

    def _checks(self) -> list[Callable[[], Awaitable[None]]]:
        return [
            self.schema_is_served,
            self.echo_socket_echoes,
            self.no_step_without_consent,
            self.no_game_without_cookie,
            self.consent_leads_to_a_game,
            self.other_messages_wait_for_hello,
            self.hello_is_answered_by_welcome,
            self.wrong_messages_change_nothing,
            self.binary_frames_close_the_socket,
            self.long_frames_close_the_socket,
            self.other_protocols_are_refused,
            self.newest_tab_plays,
            self.states_follow_the_rules,
            self.inputs_are_applied,
            self.away_pauses_and_ready_continues,
            self.lost_connections_resume,
        ]

    async def schema_is_served(self) -> None:
        """/protocol.json has the messages of this protocol"""
        async with httpx.AsyncClient(base_url=self.url, timeout=self.within_s) as http:
            answer = await http.get("/protocol.json")
        require(answer.status_code == 200, f"it answered {answer.status_code}")
        schema = msgspec.json.decode(answer.content)
        require(schema.get("x-protocol") == messages.PROTOCOL, f"its x-protocol is {schema.get('x-protocol')}")
        missing = {"Hello", "Input", "Welcome", "Tick", "Ended"} - set(schema.get("$defs", {}))
        require(not missing, f"it lacks {', '.join(sorted(missing))}")

    async def echo_socket_echoes(self) -> None:
        """/s/STUDY/check echoes the first 16 characters of a frame"""
        async with self.open(f"/s/{self.study}/check", cookie="") as socket:
            await socket.send("0123456789abcdefgh")
            echo = await self.received(socket)
        require(echo == "0123456789abcdef", f"it answered {echo!r}")

    async def no_step_without_consent(self) -> None:
        """/s/STUDY/now leads to the consent page if there is no cookie"""
        async with httpx.AsyncClient(base_url=self.url, timeout=self.within_s) as http:
            answer = await http.get(self.client.now, headers={"Accept": "text/html"})
        there = httpx.URL(answer.headers.get("location", "")).path
        consent = f"{httpx.URL(self.url).path.rstrip('/')}/s/{self.study}"  # the server may be below a path
        require((answer.status_code, there) == (303, consent), f"it answered {answer.status_code} {there}")

    async def no_game_without_cookie(self) -> None:
        """the game's socket refuses a handshake without a cookie with 403"""
        try:
            async with self.open(f"/s/{self.study}/socket", cookie=""):
                raise Unmet("it opened")
        except InvalidStatus as refused:
            status = refused.response.status_code
            require(status == 403, f"it answered {status}")

    async def consent_leads_to_a_game(self) -> None:
        """consent sets a cookie, and the pages lead to a game"""
        page = await self.client.consent()
        require(bool(self.client.token), "there is no cookie")
        for _ in range(_MAX_PAGES):
            if page.is_game:
                return
            require(page.code is None, "the study ended before a game")
            require(not page.faults, f"a page came back for {', '.join(sorted(page.faults))}")
            page = await self.client.submit(page)
        raise Unmet(f"there was no game in {_MAX_PAGES} pages")

    async def other_messages_wait_for_hello(self) -> None:
        """a message before hello is refused as `hello_first`"""
        async with self.game() as socket:
            await send(socket, messages.Ready())
            refused = await self.until(socket, messages.Refused)
            require(refused.code == "hello_first", f"the code was {refused.code}")

    async def hello_is_answered_by_welcome(self) -> None:
        """hello is answered by a welcome with a kitchen, a seat and a state"""
        async with self.game() as socket:
            await send(socket, hello())
            first: messages.ToBrowser = messages.Ping(0)
            while isinstance(first, messages.Ping):  # may come before it
                first = await self.until(socket, messages.ToBrowser)
        if not isinstance(first, messages.Welcome):
            raise Unmet(f"the first message was {name_of(first)}")
        require(first.protocol == messages.PROTOCOL, f"its protocol is {first.protocol}")
        require(first.seat in range(PLAYERS), f"its seat is {first.seat}")
        SeenKitchen(first).show(first.state)

    async def wrong_messages_change_nothing(self) -> None:
        """an unknown field, type or action is refused as `bad_message`, and the socket stays open"""
        wrong = ('{"type": "ready", "more": 1}', '{"type": "unknown"}', '{"type": "input", "seq": 1, "held": 9}', "{")
        async with self.welcomed() as (socket, _):
            for frame in wrong:
                await socket.send(frame)
                refused = await self.until(socket, messages.Refused)
                require(refused.code == "bad_message", f"{frame} was refused as {refused.code}")

    async def binary_frames_close_the_socket(self) -> None:
        """a binary frame closes the socket with 1003"""
        async with self.welcomed() as (socket, _):
            await socket.send(b"\x00")
            await self.closed(socket, CloseCode.NOT_TEXT)

    async def long_frames_close_the_socket(self) -> None:
        """a frame of more than 1024 bytes closes the socket with 1009"""
        async with self.welcomed() as (socket, _):
            await socket.send(" " * (messages.MAX_FRAME_BYTES + 1))
            await self.closed(socket, CloseCode.TOO_LARGE)

    async def other_protocols_are_refused(self) -> None:
        """another protocol number is refused as `protocol`, and the socket closes with 1008"""
        async with self.game() as socket:
            await send(socket, messages.Hello(messages.PROTOCOL + 1, "conformance"))
            refused = await self.until(socket, messages.Refused)
            require(refused.code == "protocol", f"the code was {refused.code}")
            await self.closed(socket, CloseCode.REFUSED)

    async def newest_tab_plays(self) -> None:
        """a second tab takes over: the first one gets `superseded` and is closed with 4001"""
        async with self.welcomed() as (first, _), self.game() as second:
            await send(second, hello("conformance-2"))
            await self.until(second, messages.Welcome)
            await self.until(first, messages.Superseded)
            await self.closed(first, CloseCode.SUPERSEDED)

    async def states_follow_the_rules(self) -> None:
        """after ready, a countdown and then ticks: every state follows from the one before and its actions"""
        async with self.welcomed() as (socket, welcome):
            await send(socket, messages.Ready())
            await self.until(socket, messages.Countdown)
            kitchen, before = SeenKitchen(welcome), await self.until(socket, messages.Tick)
            compared = 0
            while compared < _TIMESTEPS:
                tick = await self.until(socket, messages.Tick)
                if tick.state.t == before.state.t + 1:
                    kitchen.show(before.state)
                    expected = kitchen.now
                    expected.step(np.array([tick.actions]), np.zeros((1, PLAYERS), np.int32))
                    same = kitchen.show(tick.state) == expected.hash()
                    require(same, f"the state of timestep {tick.state.t} does not follow from {tick.actions}")
                    compared += 1
                else:
                    require(tick.state.t >= before.state.t, f"timestep {tick.state.t} came after {before.state.t}")
                before = tick

    async def inputs_are_applied(self) -> None:
        """a tap is applied once, and the tick's `applied` has its number"""
        async with self.welcomed() as (socket, welcome):
            await send(socket, messages.Ready())
            await self.until(socket, messages.Countdown)
            tick = await self.until(socket, messages.Tick)
            while tick.state.t == welcome.state.t:  # the tick with the state in which the countdown ends
                tick = await self.until(socket, messages.Tick)
            await send(socket, messages.Input(1, None, 0, 0.0))
            sent_at = tick.state.t
            while tick.applied < 1:
                require(tick.state.t < sent_at + _APPLIED_WITHIN, f"it was not applied in {_APPLIED_WITHIN} timesteps")
                tick = await self.until(socket, messages.Tick)
            own = [tick.actions[welcome.seat]]
            own += [(await self.until(socket, messages.Tick)).actions[welcome.seat] for _ in range(2)]
            require(own.count(0) == 1, f"north was tapped once, but these actions were applied: {own}")
            require(set(own) <= {0, STAY}, f"only north was tapped, but these actions were applied: {own}")

    async def away_pauses_and_ready_continues(self) -> None:
        """away pauses the game, and ready continues it after a countdown"""
        async with self.welcomed() as (socket, _):
            await send(socket, messages.Ready())
            await self.until(socket, messages.Tick)
            await send(socket, messages.Away("blur"))
            paused = await self.until(socket, messages.Paused)
            require(paused.reason == "blur", f"it paused for {paused.reason}")
            await send(socket, messages.Ready())
            await self.until(socket, messages.Countdown)

    async def lost_connections_resume(self) -> None:
        """a connection that was lost resumes the same episode, not before its last state"""
        async with self.welcomed() as (socket, welcome):
            await send(socket, messages.Ready())
            last = await self.until(socket, messages.Tick)
            socket.transport.abort()
        async with self.welcomed() as (_, again):
            require(again.episode == welcome.episode, f"episode {welcome.episode} became {again.episode}")
            require(again.resumed, "its welcome does not say `resumed`")
            require(
                again.state.t >= last.state.t, f"timestep {last.state.t} was seen, and it resumed at {again.state.t}"
            )


async def _finding(check: Callable[[], Awaitable[None]]) -> Finding:
    """Run one check; any failure of the server becomes a finding."""
    name = " ".join((check.__doc__ or "").split())
    try:
        await check()
    except Unmet as unmet:
        return Finding(name, False, str(unmet))
    except (ClientFailed, ProtocolError, LayoutError, msgspec.DecodeError, httpx.HTTPError) as error:
        return Finding(name, False, str(error) or type(error).__name__)
    except (*_CANNOT_CONNECT, ConnectionClosed, ValueError) as error:
        return Finding(name, False, f"{type(error).__name__}: {error}")
    return Finding(name, True)
