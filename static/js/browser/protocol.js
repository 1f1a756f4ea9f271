// Written by `python -m server.play.browser_sources`. Do not edit.

export const PROTOCOL = 1;

/** Why a websocket closes; see docs/reference/protocol.md. */
export const CloseCode = Object.freeze({
  FINISHED: 1000,
  SILENT: 1001,
  NOT_TEXT: 1003,
  LOST: 1006,
  NOT_UTF8: 1007,
  REFUSED: 1008,
  TOO_LARGE: 1009,
  FAILED: 1011,
  RESTARTING: 1012,
  TRY_LATER: 1013,
  SUPERSEDED: 4001,
  SIGNED_OUT: 4003,
  NO_GAME: 4004,
  GAME_READY: 4005,
});
