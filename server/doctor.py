"""Check whether this machine is ready to serve: settings, secret, port, database, Redis, disk, studies, weights, TLS.
It writes no file, starts nothing, and connects only to its port, the database, Redis and the server's public address.
"""

import http.client
import json
import os
import shutil
import socket
import ssl
import stat
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final, Literal
from urllib.parse import urlsplit

from sqlalchemy import inspect

from models.networks.checkpoint import CheckpointError, load_checkpoint
from server.commands.serve import listen
from server.participation.own_kitchens import load_with_kitchens
from server.required_models import folder_of, required_models
from server.settings import Settings
from server.store import engines
from server.store.database import Database, DatabaseDown
from server.store.engines import encoding_problem, normal_url
from server.store.kitchens import grids_at
from server.store.migrate import known_revisions, revision_of
from server.study.loader import StudyError, StudyFile
from server.study_check import stage_problems

MIN_FREE_GB: Final = 1.0
SOME_FREE_GB: Final = 5.0
RENEW_DAYS: Final = 14
PATIENCE_S: Final = 5.0
_MAX_ANSWER_BYTES: Final = 1000
Grade = Literal["good", "look", "bad"]


@dataclass(frozen=True)
class HealthFinding:
    """The result of one check. `look`: a warning; the server can run, but somebody should look at it first."""

    about: str
    grade: Grade
    text: str


def examine(settings: Settings) -> Iterator[HealthFinding]:
    """Check everything that the server needs with these settings."""
    checks: tuple[Callable[[Settings], Iterator[HealthFinding]], ...] = (
        _secret,
        _port,
        _database,
        _redis,
        _disk,
        _studies,
        _tls,
    )
    for check in checks:
        yield from check(settings)


def _secret(settings: Settings) -> Iterator[HealthFinding]:
    if settings.secret is not None:
        yield HealthFinding("secret", "good", "KITCHENMIND_SECRET is set")
        return
    path = settings.data / "secret"
    if path.is_file() and stat.S_IMODE(path.stat().st_mode) & 0o077:
        yield HealthFinding("secret", "bad", f"{path} can be read by others. Run `chmod 600 {path}`.")
    else:
        is_there = path.is_file() and path.stat().st_size > 0
        yield HealthFinding("secret", "good", f"{'kept in' if is_there else 'will be created in'} {path}")


def _port(settings: Settings) -> Iterator[HealthFinding]:
    try:
        listen(settings.host, settings.port).close()
    except OSError as error:
        if _serves(settings.host, settings.port):
            place = f"{settings.host}:{settings.port}"
            yield HealthFinding("port", "good", f"a kitchenmind server is already running at {place}")
        else:
            yield HealthFinding("port", "bad", str(error))
    else:
        yield HealthFinding(
            "port", "good", f"{settings.host}:{settings.port} is free" if settings.port else "any free one"
        )


def _serves(host: str, port: int) -> bool:
    """Return whether a server of this project answers there."""
    here = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)  # noqa: S104 what listens everywhere also listens here
    connection = http.client.HTTPConnection(here, port, timeout=PATIENCE_S)
    try:
        connection.request("GET", "/health/live")
        answer = json.loads(connection.getresponse().read(_MAX_ANSWER_BYTES))
    except (OSError, http.client.HTTPException, ValueError):
        return False
    finally:
        connection.close()
    return isinstance(answer, dict) and answer.get("server") == "kitchenmind"


def _database(settings: Settings) -> Iterator[HealthFinding]:
    url = normal_url(settings.database)
    shown = engines.shown(url)
    if url.get_backend_name() == "sqlite" and not Path(str(url.database)).exists():
        place = _nearest(Path(str(url.database)))
        if place.is_dir() and os.access(place, os.W_OK):
            yield HealthFinding("database", "good", f"{url.database} will be created")
        else:
            yield HealthFinding(
                "database", "bad", f"{place} cannot be written to. Use another path, or its owner's account."
            )
        return
    try:
        with Database(settings.database, read_only=True) as database:
            problem = "" if url.get_backend_name() == "sqlite" else database.read_now(encoding_problem)
            revision = database.read_now(revision_of)
            empty = not database.read_now(lambda connection: inspect(connection).get_table_names())
    except DatabaseDown as error:
        yield HealthFinding("database", "bad", f"cannot read {shown}: {error}")
        return
    if problem:
        yield HealthFinding("database", "bad", problem)
    elif empty:
        yield HealthFinding("database", "good", f"{shown} is empty: tables will be created")
    elif revision is None:
        yield HealthFinding("database", "bad", f"{shown} is not a kitchenmind database. Name another with --database.")
    elif revision not in known_revisions():
        yield HealthFinding(
            "database", "bad", f"{shown} was made by a later kitchenmind. Use that one, or a later one."
        )
    elif revision != known_revisions()[0]:
        yield HealthFinding(
            "database", "look", f"{shown} is of an earlier version and will be upgraded. Make a backup first."
        )
    else:
        yield HealthFinding("database", "good", f"{shown} exists and is up to date")


def _redis(settings: Settings) -> Iterator[HealthFinding]:
    if settings.redis is None:
        return
    from redis import Redis  # here: who serves with one process does not wait for it
    from redis.exceptions import RedisError

    redis = Redis.from_url(
        settings.redis.get_secret_value(), socket_timeout=PATIENCE_S, socket_connect_timeout=PATIENCE_S
    )
    try:
        redis.set("kitchenmind:doctor", 1, px=1)  # a Redis whose disk is full answers, but takes nothing
    except (RedisError, OSError) as error:
        yield HealthFinding("redis", "bad", f"it cannot be used: {error}. Start or repair it, or correct --redis.")
    else:
        yield HealthFinding("redis", "good", "it answers")
    finally:
        redis.close()


def _disk(settings: Settings) -> Iterator[HealthFinding]:
    url = normal_url(settings.database)
    if url.get_backend_name() != "sqlite":
        return
    place = _nearest(Path(str(url.database)))
    free_gb = shutil.disk_usage(place).free / 1e9
    text = f"{free_gb:.1f} GB free at {place}"
    if free_gb < MIN_FREE_GB:
        yield HealthFinding(
            "disk", "bad", f"{text}. Make room, or put the database elsewhere: a full disk pauses every game."
        )
    else:
        yield HealthFinding("disk", "good" if free_gb >= SOME_FREE_GB else "look", text)


def _studies(settings: Settings) -> Iterator[HealthFinding]:
    sound: list[StudyFile] = []
    for path in settings.studies:
        try:
            grids = partial(grids_at, settings.database)
            file = load_with_kitchens(path, grids, settings.models_folder, settings.own_models)
            problems = [(problem.warning, file.describe(problem)) for problem in stage_problems(file)]
            if settings.redis is not None:
                from server.cluster.game_owner import refuse_pairs

                refuse_pairs([file])
        except StudyError as error:
            yield from (HealthFinding("study", "bad", line) for line in error.lines)
            continue
        except OSError as error:
            reason = error.strerror or "No such file"
            yield HealthFinding("study", "bad", f"{path}: {reason}. Correct KITCHENMIND_STUDIES or --study.")
            continue
        mild: Grade = "bad" if settings.mode == "production" else "look"
        for warning, line in [*((True, line) for line in file.warnings), *problems]:
            yield HealthFinding("study", mild if warning else "bad", line)
        if not any(not warning for warning, _ in problems):
            yield HealthFinding("study", "good", f"{path} is valid (version {file.sha256[:12]})")
            sound.append(file)
    yield from _weights(sound)


def _weights(files: list[StudyFile]) -> Iterator[HealthFinding]:
    required = required_models(files)
    models = (*required.agents, *required.predictors)
    folders = {folder_of(layout, required.paths.located(layout, model)) for layout, model in models}
    whole = 0
    for folder in sorted(folder for folder in folders if (folder / "config.json").is_file()):
        try:
            load_checkpoint(folder)
            whole += 1
        except CheckpointError as error:
            yield HealthFinding("weights", "bad", str(error))
    yield HealthFinding("weights", "good", f"{whole} agents and predictors, byte for byte as they were saved")


def _tls(settings: Settings) -> Iterator[HealthFinding]:
    url = urlsplit(settings.public_url)
    if url.scheme != "https" or url.hostname is None:
        yield HealthFinding("TLS", "good", f"not needed: only this machine reaches {settings.host}")
        return
    try:
        days = _days_of_certificate(url.hostname, url.port or 443)
    except ssl.SSLCertVerificationError as error:
        remedy = "Give the proxy a certificate that browsers trust."
        yield HealthFinding(
            "TLS", "bad", f"the certificate of {url.hostname} is refused: {error.verify_message}. {remedy}"
        )
    except OSError as error:
        remedy = "Start the TLS proxy, or correct KITCHENMIND_PUBLIC_URL."
        yield HealthFinding(
            "TLS", "bad", f"{settings.public_url} does not answer ({error.strerror or error}). {remedy}"
        )
    else:
        grade: Grade = "good" if days >= RENEW_DAYS else "look"
        yield HealthFinding("TLS", grade, f"the certificate of {url.hostname} is good for {days:.0f} days")


def _days_of_certificate(host: str, port: int) -> float:
    """Return how many days it is valid. Raises ssl.SSLCertVerificationError, OSError."""
    context = ssl.create_default_context()
    with (
        socket.create_connection((host, port), PATIENCE_S) as line,
        context.wrap_socket(line, server_hostname=host) as tls,
    ):
        certificate = tls.getpeercert() or {}
    return (ssl.cert_time_to_seconds(str(certificate["notAfter"])) - time.time()) / 86400


def _nearest(path: Path) -> Path:
    """Return the path, or its nearest parent that exists."""
    while not path.exists():
        path = path.parent
    return path
