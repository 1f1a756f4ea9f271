"""Why a websocket closes, as its close code says: one table for the server, the pages and the simulated participants.

docs/reference/protocol.md says what a client does with each; static/js/browser/protocol.js is written from this file.
"""

from enum import IntEnum


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
    NO_GAME = 4004  # the participant's current step is not a game: reload the page
    GAME_READY = 4005  # the wait for another person is over: connect again at once
