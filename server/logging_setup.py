"""Configure logging: lines of text for people, or of JSON for machines."""

import logging
import os
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from structlog.types import EventDict, Processor, WrappedLogger


def configure(form: Literal["text", "json"]) -> None:
    """Let every logger write to standard error: warnings and worse as text, all from INFO on as JSON."""
    handler = logging.StreamHandler()
    handler.setFormatter(_formatter(form))
    root = logging.getLogger()
    root.handlers = [handler]
    root.setLevel(logging.INFO if form == "json" else logging.WARNING)
    for chatty in ("httpx", "httpcore", "alembic", "asyncio"):
        logging.getLogger(chatty).setLevel(logging.WARNING)


def _formatter(form: Literal["text", "json"]) -> logging.Formatter:
    if form == "text":
        return logging.Formatter("%(levelname)s %(name)s: %(message)s")
    import structlog  # here: a server that starts does not wait for what it does not use

    about: list[Processor] = [
        structlog.stdlib.add_log_level,
        structlog.stdlib.add_logger_name,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
        _process,
        structlog.processors.format_exc_info,
    ]
    last: list[Processor] = [
        structlog.stdlib.ProcessorFormatter.remove_processors_meta,
        structlog.processors.JSONRenderer(),
    ]
    return structlog.stdlib.ProcessorFormatter(foreign_pre_chain=about, processors=last)


def _process(_: "WrappedLogger", __: str, event: "EventDict") -> "EventDict":
    """Return the name of this server process, if there are several."""
    event["process"] = os.getpid()
    return event
