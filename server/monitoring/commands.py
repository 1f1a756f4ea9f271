"""The commands a researcher gives to running games, as messages: in the same form within a process and between
processes.
"""

from msgspec import Struct


class GameCommand(Struct, frozen=True, tag_field="command"):
    """Something to do with one game. It has an effect only in the process that plays the game."""

    episode: str


class PauseGame(GameCommand, frozen=True, tag="pause_game"):
    """Pause the game until it is resumed."""


class ResumeGame(GameCommand, frozen=True, tag="resume_game"):
    """Let a held game continue."""


class SendMessage(GameCommand, frozen=True, tag="send_message"):
    """Show a text to the participant."""

    text: str


class ExtendAbsence(GameCommand, frozen=True, tag="extend_absence"):
    """Allow people to be away longer in this game. `seconds`: than its study says, with what was allowed before."""

    seconds: float


class EndGame(GameCommand, frozen=True, tag="end_game"):
    """End the game; what was played stays stored."""


class EndGames(Struct, frozen=True, tag_field="command", tag="end_games"):
    """End those of the games that run in the process that receives this."""

    episodes: list[str]


class DismissParticipant(Struct, frozen=True, tag_field="command", tag="dismiss_participant"):
    """Close the sockets of a participant who was deleted."""

    participant: str


class PauseStudy(Struct, frozen=True, tag_field="command", tag="pause_study"):
    """Pause all games of a study, also those that start later."""

    study: str


class ResumeStudy(Struct, frozen=True, tag_field="command", tag="resume_study"):
    """Let a held study continue."""

    study: str


class MessageStudy(Struct, frozen=True, tag_field="command", tag="message_study"):
    """Show a text in every running game of a study."""

    study: str
    text: str


class PrepareVersion(Struct, frozen=True, tag_field="command", tag="prepare_version"):
    """Prepare to serve a version of a study that is in the database."""

    study: str
    sha256: str


class OpenVersion(Struct, frozen=True, tag_field="command", tag="open_version"):
    """Serve a prepared version to new participants. `at`: when it was chosen, in Unix seconds."""

    study: str
    sha256: str
    at: float


AnyGameCommand = PauseGame | ResumeGame | SendMessage | ExtendAbsence | EndGame
BroadcastCommand = (  # to all
    EndGames | DismissParticipant | PauseStudy | ResumeStudy | MessageStudy | PrepareVersion | OpenVersion
)
Command = AnyGameCommand | BroadcastCommand
