"""`kitchenmind.client`: a program takes part in a study, and the guide's player is one."""

import asyncio
import io
import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path

import certifi
import msgspec
import pytest
from websockets.asyncio.server import ServerConnection, serve

from kitchenmind.client import ClientFailed, GameClient, ParsedPage, ProtocolError, StudyClient, take_part
from kitchenmind.client.pages import filled_in
from kitchenmind.client.study_client import _certificates
from models.agents.planner import PlannerPolicy
from server.play import messages
from server.store.database import Database
from server.store.tables import participants
from tests.support.live_server import LiveServer
from tests.test_guides import ROOT, blocks

GUIDE = ROOT / "docs" / "guides" / "write_a_client.md"


class Planner(GameClient):
    policy = PlannerPolicy()

    def act(self, tick: messages.Tick) -> int | None:
        assert self.kitchen is not None
        return self.kitchen.decide(self.policy)


COLD = """
import asyncio
from kitchenmind.client import GameClient, game_client
from overcooked.rules import step

async def connect(*_, **__):
    print("compiled" if step.signatures else "not compiled")
    raise SystemExit

game_client.connect = connect
asyncio.run(GameClient("ws://127.0.0.1:1/s/x/socket").play())
"""


def test_the_rules_are_compiled_before_the_game_is_joined() -> None:
    """A compilation takes seconds, in which no ping is answered."""
    done = subprocess.run([sys.executable, "-c", COLD], capture_output=True, text=True, cwd=ROOT, check=False)
    assert (done.stdout.strip(), done.stderr) == ("compiled", "")


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    with LiveServer(tmp_path_factory.mktemp("served")) as serving:
        yield serving


@pytest.fixture(scope="module")
def quick_look(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    study = (ROOT / "studies" / "quick_look.yaml").read_text(encoding="utf-8")
    with LiveServer(tmp_path_factory.mktemp("quick_look"), study=study) as serving:
        yield serving


async def test_a_player_completes_a_study_and_is_stored_as_simulated(live: LiveServer) -> None:
    done = await take_part(live.url, "short", Planner)
    assert done.code
    assert [ended.reason for ended in done.games][:1] == ["lessons"]
    assert done.games[-1].reason == "horizon"
    with Database(live.database, read_only=True) as database:
        stored = await database.read(lambda connection: connection.execute(participants.select()).all())
    assert {(row.status, row.simulated) for row in stored} == {("completed", True)}


async def test_guide_s_player_does_what_the_guide_describes(quick_look: LiveServer) -> None:
    """Its text is run as it stands, but for the address of the server."""
    (text,) = [text for mark, text in blocks(GUIDE) if mark == "python player.py"]
    assert "http://127.0.0.1:8000" in text
    program = compile(text.replace("http://127.0.0.1:8000", quick_look.url), "player.py", "exec")
    out = io.StringIO()

    def play() -> None:
        with redirect_stdout(out):
            exec(program, {"__name__": "player"})

    await asyncio.to_thread(play)
    assert "points (horizon)" in out.getvalue()
    assert out.getvalue().splitlines()[-1].startswith("code: ")


async def test_guide_s_page_by_page_client_reaches_the_code(quick_look: LiveServer) -> None:
    (text,) = [text for mark, text in blocks(GUIDE) if mark == "python"]
    names: dict[str, object] = {"Polite": Planner}
    exec(text.replace("http://127.0.0.1:8000", quick_look.url), names)
    assert await names["take_part"]()  # type: ignore[operator]


async def test_it_comes_back_after_a_lost_connection_and_plays_on(live: LiveServer) -> None:
    class Losing(Planner):
        losses = 0
        first_wait_s = 0.01

        async def before_acting(self, socket: object, tick: messages.Tick) -> None:
            if tick.state.t >= 3 and not self.losses:
                type(self).losses += 1
                socket.transport.abort()  # type: ignore[attr-defined]
                raise OSError("the line is cut")

    done = await take_part(live.url, "short", Losing)
    assert done.code
    assert Losing.losses == 1


async def test_unknown_study_and_empty_forms_are_named(live: LiveServer) -> None:
    with pytest.raises(ClientFailed, match="GET /s/nowhere answered 404"):
        await take_part(live.url, "nowhere")
    async with StudyClient(live.url, "short") as client:
        with pytest.raises(ClientFailed, match="neither form nor game nor code"):
            await client.submit(ParsedPage("<p>nothing</p>"))


async def test_an_invalid_action_is_an_error_of_the_player(live: LiveServer) -> None:
    class Wrong(GameClient):
        def act(self, tick: messages.Tick) -> int | None:
            return 7

    with pytest.raises(ValueError, match=r"Wrong.act returned 7. An action is 0 to 5."):
        await take_part(live.url, "short", Wrong)


async def test_an_invalid_message_of_the_server_is_its_error() -> None:
    async def talk(socket: ServerConnection) -> None:
        await socket.recv()
        await socket.send('{"type": "unheard of"}')

    async with serve(talk, "127.0.0.1", 0) as serving:
        port = next(iter(serving.sockets)).getsockname()[1]
        with pytest.raises(ProtocolError, match=r"not a message \(Invalid value 'unheard of'"):
            await GameClient(f"ws://127.0.0.1:{port}/s/x/socket").play()


async def test_a_pause_that_the_server_repeats_is_answered_once() -> None:
    """A server that is stopping answers `ready` with the same pause, so that a player would never be silent."""
    sent: list[str] = []

    async def talk(socket: ServerConnection) -> None:
        async def told(*outgoing: messages.Outgoing) -> None:
            for message in outgoing:
                await socket.send(msgspec.json.encode(message).decode())

        await told(messages.Paused("server", 0.0), messages.Paused("server", 0.0), messages.Countdown(0.0))
        await told(messages.Paused("server", 0.0), messages.Paused("lost", 3.0))
        await told(messages.Ended(0, 0, 0.0, True, "/", "horizon"))
        async with asyncio.timeout(10):
            sent.extend([json.loads(frame)["type"] async for frame in socket])

    async with serve(talk, "127.0.0.1", 0) as serving:
        port = next(iter(serving.sockets)).getsockname()[1]
        await GameClient(f"ws://127.0.0.1:{port}/s/x/socket").play()
    assert sent == ["hello", "ready", "ready", "ready"]


FORM = """<form method="post" action="/s/x/now">
<input type="hidden" name="step" value="end"><input type="radio" name="scale" value="1"><input type="radio" name="scale"
value="2"><input type="checkbox" name="ways" value="a"><input type="checkbox" name="ways" value="b"><input type="number"
name="age" min="18"><textarea name="words"></textarea><select name="rank.a"></select><select name="rank.b"></select>
</form>"""


def test_answers_are_sent_and_every_other_question_gets_a_plain_one() -> None:
    fields = ParsedPage(FORM).form("/s/x/now")
    assert fields is not None
    plain = {"step": "end", "scale": "1", "ways": ["a"], "age": "18", "words": "-", "rank.a": "1", "rank.b": "2"}
    assert filled_in(fields, {}) == plain
    given = {"scale": 2, "ways": ["a", "b"], "unknown": 1, "step": "another"}
    assert filled_in(fields, given) == plain | {"scale": "2", "ways": ["a", "b"]}


def test_a_client_trusts_the_certificates_that_the_environment_names_now(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    everybody = Path(certifi.where()).read_text("utf-8").split("-----END CERTIFICATE-----")
    for count in (2, 1):
        file = tmp_path / f"{count}.pem"
        file.write_text("".join(f"{one}-----END CERTIFICATE-----" for one in everybody[:count]), "utf-8")
        monkeypatch.setenv("SSL_CERT_FILE", str(file))
        assert len(_certificates().get_ca_certs()) == count
    assert _certificates() is _certificates(), "read once"
