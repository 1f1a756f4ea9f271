"""`kitchenmind serve`: upgrade the database, start the models, serve the pages. Imports are inside functions, so that
--help is quick.
"""

import argparse
import asyncio
import faulthandler
import gc
import signal
import socket
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from server.cluster.supervisor import Supervised, Supervisor, supervised

if TYPE_CHECKING:
    import uvicorn
    from fastapi import FastAPI

    from models.inference.launch import Launched
    from server.settings import Settings

_UNSENT_GIVE_UP_MS = 10_000  # a peer that reads nothing for so long is gone, even if its socket is open
_KILL_AFTER_S = 3.0  # then the process is killed: every tick is stored anyway
_SEND_BUFFER_BYTES = 64 * 1024  # bytes that the kernel may buffer for a slow reader


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--study", action="append", type=Path, metavar="FILE", help="a study file; may be repeated")
    parser.add_argument(
        "--bundle", type=Path, metavar="FILE", help="run exactly the study in this archive of `kitchenmind bundle`"
    )
    parser.add_argument(
        "--allow-model",
        action="append",
        default=[],
        metavar="NAME",
        help="a module:Class or address that the bundle may use; may be repeated",
    )
    parser.add_argument("--host", help="address to listen on (127.0.0.1)")
    parser.add_argument("--port", type=int, help="port to listen on (8000; 0 takes a free one)")
    parser.add_argument("--data", type=Path, metavar="DIR", help="the folder for the database and what else is kept")
    parser.add_argument("--database", metavar="URL", help="sqlite:///path or postgresql://user@host/name")
    parser.add_argument("--workers", type=int, metavar="N", help="server processes (1); more need PostgreSQL and Redis")
    parser.add_argument("--redis", metavar="URL", help="redis://host:6379/0, for several server processes")
    parser.add_argument(
        "--model-workers", type=int, metavar="N", help="processes that run models, for each server process (1)"
    )
    parser.add_argument("--speed", type=float, help=argparse.SUPPRESS)


def run(arguments: argparse.Namespace) -> int:
    """Serve until a stop signal. Return 2 if a setting or study is wrong, 1 if the server could not start."""
    with ExitStack() as stack:
        try:
            stack.enter_context(unbundled(arguments))
            settings = settings_of(arguments)
            settings.make_data_folder()
            process = supervised()
            listening = stack.enter_context(process.listening if process else listen(settings.host, settings.port))
        except (ValueError, OSError) as error:
            return _refuse(error, 2)
        if settings.workers > 1 and process is None:
            return _serve_several(settings, listening)
        return serve(settings, listening, process)


@contextmanager
def unbundled(arguments: argparse.Namespace) -> Iterator[None]:
    """Use the bundle's study, if one is named, as the only study file. Raises BundleRefused, OSError; ValueError if
    other studies are named too."""
    if arguments.bundle is None:
        yield
        return
    from server.bundle.making import open_bundle
    from server.settings import own_models_here

    if arguments.study:
        raise ValueError("--bundle runs its own study: leave --study out.")
    bundle = open_bundle(arguments.bundle, arguments.allow_model, own_models_here(arguments.data))
    with tempfile.TemporaryDirectory(prefix="kitchenmind-bundle-") as folder:
        path = Path(folder) / f"{bundle.file.study.name}.yaml"
        path.write_text(bundle.file.text, encoding="utf-8", newline="")
        arguments.study, arguments.models_folder = [path], arguments.bundle.absolute().parent
        yield


def settings_of(arguments: argparse.Namespace) -> "Settings":
    """Return the environment's settings, overridden by those of the command line. Raises ValueError."""
    from server.settings import settings_with
    from server.store.engines import normal_url

    settings = settings_with(
        studies=tuple(arguments.study) if arguments.study else None,
        models_folder=getattr(arguments, "models_folder", None),
        host=arguments.host,
        port=arguments.port,
        data=getattr(arguments, "data", None),
        database=arguments.database,
        workers=arguments.workers,
        redis=arguments.redis,
        model_workers=arguments.model_workers,
        speed=arguments.speed,
    )
    normal_url(settings.database)
    return settings


def listen(host: str, port: int) -> socket.socket:
    """Open the listening socket, so that a port in use is reported before anything starts. Raises OSError."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
    if hasattr(socket, "TCP_USER_TIMEOUT"):
        listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNSENT_GIVE_UP_MS)
    try:
        listening.bind((host, port))
        listening.listen(2048)
    except OSError as error:
        listening.close()
        raise OSError(f"cannot listen on {host}:{port} ({error.strerror}). Choose another with --port.") from None
    listening.setblocking(False)
    return listening


def _serve_several(settings: "Settings", listening: socket.socket) -> int:
    """Upgrade the database once, then start the processes."""
    from server.store.database import DatabaseDown
    from server.store.migrate import DatabaseTooNew, migrate_shared

    try:
        migrate_shared(settings.database)
    except ValueError as error:
        return _refuse(error, 2)
    except (DatabaseDown, DatabaseTooNew) as error:
        return _refuse(error, 1)
    return Supervisor(sys.argv[1:], listening, settings.workers, settings.stop_within_s + _KILL_AFTER_S).run()


def serve(settings: "Settings", listening: socket.socket, process: Supervised | None = None) -> int:
    """Run the application on the socket until a signal stops it; return the exit status."""
    from models.inference.launch import launch

    # How long a thread may delay a timestep that is due. Python's default is 5 ms.
    sys.setswitchinterval(0.001)
    gc.disable()  # the start creates no garbage; `wired` turns collection on again
    launched = launch()  # the models' process starts while this one still imports
    import uvloop

    from models.inference.supervised_worker import ModelsDown
    from server import logging_setup
    from server.monitoring.peers import ClusterDown
    from server.store.database import DatabaseDown, DatabaseInUse
    from server.store.migrate import DatabaseTooNew
    from server.study.loader import StudyError

    logging_setup.configure(settings.log)
    try:
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            runner.run(_serve(settings, listening, process, launched))
    except (StudyError, ValueError, FileNotFoundError) as error:
        return _refuse(error, 2)
    except (ModelsDown, DatabaseDown, DatabaseInUse, DatabaseTooNew, ClusterDown) as error:
        return _refuse(error, 1)
    finally:
        launched.end()
    return 0


async def _serve(
    settings: "Settings", listening: socket.socket, process: Supervised | None, launched: "Launched"
) -> None:
    from server.main import create_app, wired
    from server.uvicorn_protocols import raise_descriptor_limit

    raise_descriptor_limit()
    app = create_app(settings)
    async with wired(app, settings, launched, joins=process is not None and process.again):
        server = _server(app, settings, announced=process is None or process.first)
        loop = asyncio.get_running_loop()

        def stop(number: signal.Signals) -> None:
            """Stop with a time limit. Tasks that are not over in time are abandoned, as in a crash: everything
            acknowledged is stored. The log names the task that hung."""
            faulthandler.dump_traceback_later(settings.stop_within_s, exit=True)
            server.handle_exit(number, None)

        def alone(lifeline: int) -> None:
            loop.remove_reader(lifeline)
            stop(signal.SIGTERM)

        for number in (signal.SIGTERM, signal.SIGINT):
            loop.add_signal_handler(number, stop, number)
        if process is not None:
            loop.add_reader(process.lifeline, alone, process.lifeline)
        await server.serve(sockets=[listening])


def _server(app: "FastAPI", settings: "Settings", announced: bool = True) -> "uvicorn.Server":
    import uvicorn

    from server.play.messages import MAX_READ_BYTES
    from server.uvicorn_protocols import PatientProtocol, SparingProtocol

    class Server(uvicorn.Server):
        """Prints the address once it can be opened; pauses all games before it closes their sockets."""

        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets=sockets)
            if self.started and sockets and announced:
                _announce(settings, sockets[0])

        async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
            await app.state.services.games.stop()
            await super().shutdown(sockets=sockets)

        @contextmanager
        def capture_signals(self) -> Iterator[None]:
            """Handle signals here: uvicorn's own handler ends the process before games and database are closed."""
            yield

    return Server(
        uvicorn.Config(
            app,
            lifespan="off",
            http=PatientProtocol,
            ws=SparingProtocol,  # type: ignore[arg-type] # uvicorn does with it what any protocol can
            ws_max_size=MAX_READ_BYTES,
            ws_per_message_deflate=False,
            ws_ping_interval=None,
            access_log=False,
            log_level="warning",
            proxy_headers=settings.mode == "production",
            forwarded_allow_ips=settings.trusted_proxies,
            server_header=False,
            timeout_graceful_shutdown=10,
        )
    )


def _announce(settings: "Settings", listening: socket.socket) -> None:
    """Print the address. The server serves also where this cannot be written, because the disk of its log is full."""
    from server.settings import IS_CHECKOUT, program

    create = f"{program()} admin create NAME --role own{settings.data_option}"
    lines = [
        *([] if IS_CHECKOUT else [f"data are kept in {settings.data.absolute()}"]),
        f"kitchenmind is at {_address(listening)}  (stop with Ctrl+C)",
        f"the dashboard is at /admin; `{create}` makes an account for it",
    ]
    with suppress(OSError):
        print("\n".join(lines), flush=True)


def _address(listening: socket.socket) -> str:
    host, port = listening.getsockname()[:2]
    if host in ("0.0.0.0", "::"):  # noqa: S104
        host = "127.0.0.1"
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def _refuse(error: Exception, status: int) -> int:
    print(f"kitchenmind serve: {error}", file=sys.stderr)
    return status
