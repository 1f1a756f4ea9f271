"""An async client of a whole study: pages, forms and the game. The simulated participants use it too.

docs/guides/write_a_client.md writes a player with it; docs/reference/protocol.md describes what travels.
"""

from kitchenmind.client.game_client import GameClient as GameClient
from kitchenmind.client.game_client import ProtocolError as ProtocolError
from kitchenmind.client.pages import ParsedPage as ParsedPage
from kitchenmind.client.seen_kitchen import SeenKitchen as SeenKitchen
from kitchenmind.client.study_client import ClientFailed as ClientFailed
from kitchenmind.client.study_client import StudyClient as StudyClient
from kitchenmind.client.study_client import StudyResult as StudyResult
from kitchenmind.client.study_client import take_part as take_part
