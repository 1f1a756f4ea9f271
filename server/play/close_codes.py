"""Close codes of websockets: one table for the server, the pages and the simulated participants.

docs/reference/protocol.md says what a client does with each; static/js/browser/protocol.js is written from this file.
"""

from collections.abc import Mapping
from enum import IntEnum
from typing import Final


class CloseCode(IntEnum):
    """1000 to 1015 are those of RFC 6455, the ones from 4000 on are ours."""

    FINISHED = 1000  # the episode is over, or the client closed
    SILENT = 1001  # the client has not answered a Ping for too long
    NOT_TEXT = 1003  # a binary frame
    LOST = 1006  # never sent: what a client reports when the connection broke
    NOT_UTF8 = 1007
    REFUSED = 1008  # not allowed here, too much, or another version of the protocol: reload the page
    TOO_LARGE = 1009
    FAILED = 1011  # the server failed: connect again, later each time
    RESTARTING = 1012
    TRY_LATER = 1013  # the database is away
    SUPERSEDED = 4001  # another tab has taken over
    SIGNED_OUT = 4003  # a researcher's session has ended or changed: reload the page
    NO_GAME = 4004  # the participant's current step is not a game, or the cookie no longer counts: reload the page
    GAME_READY = 4005  # the wait for another person is over: connect again at once


# Code -> (cause, what a client does), as in the table of docs/reference/protocol.md.
CAUSES: Final[Mapping[CloseCode, tuple[str, str]]] = {
    CloseCode.FINISHED: ("the episode is over, or the client closed", "loads `next` if `ended` came"),
    CloseCode.SILENT: ("the page did not answer", "reconnects"),
    CloseCode.NOT_TEXT: ("a binary frame", "must be fixed"),
    CloseCode.LOST: ("the connection broke, without a close frame", "reconnects"),
    CloseCode.NOT_UTF8: ("a text frame that is not UTF-8", "must be fixed"),
    CloseCode.REFUSED: ("the client exceeds a limit, or uses another protocol version", "reloads the page"),
    CloseCode.TOO_LARGE: ("a frame of more than 1024 bytes", "must be fixed"),
    CloseCode.FAILED: ("the server failed", "reconnects, with growing delays"),
    CloseCode.RESTARTING: ("the server is being restarted", "reconnects"),
    CloseCode.TRY_LATER: ("the database is not available", "reconnects"),
    CloseCode.SUPERSEDED: ("another tab has taken over", "says so, and offers to continue in this tab"),
    CloseCode.SIGNED_OUT: (
        "on a researcher's pages: the session has ended or now shows other data",
        "reloads the page",
    ),
    CloseCode.NO_GAME: ("there is no game to play, or the cookie is not valid (any longer)", "loads `/s/{study}/now`"),
    CloseCode.GAME_READY: ("the wait for another person is over", "reconnects at once"),
}
