"""The watched chef's actual next interactions, compared with an episode worked out by hand."""

from dataclasses import replace

import pytest
from msgspec import structs

from models.protocols import INTENTION_HORIZON, Intention
from overcooked.constants import EAST, INTERACT, NORTH, SOUTH, STAY, WEST
from overcooked.interactions import InteractionKind
from overcooked.layout import parse_layout
from server.store import episodes, studies, ticks
from server.store.accuracy import RunningAccuracy
from server.store.database import Database
from server.store.interactions import UNKNOWN, hits, next_interactions
from server.store.packed_intentions import pack, pack_shown, unpack, unpack_shown
from tests.support.study_data import SPEC, played, result_of

ROOM = parse_layout("XXPX\nO12X\nXDSX", "room")
NONE = (InteractionKind.NONE, -1, -1, 0)


def actions(*chef: int) -> list[tuple[int, int]]:
    return [(action, STAY) for action in chef]


def test_each_state_has_the_next_use_of_a_station_and_its_time() -> None:
    taken = next_interactions(ROOM, actions(WEST, INTERACT, SOUTH, INTERACT, EAST), 0)
    onion = (InteractionKind.TAKE_ONION, 0, 1)
    assert taken[:2].tolist() == [[*onion, 2], [*onion, 1]]
    assert taken[2:].tolist() == [[UNKNOWN] * 4] * 4, "a hand with an onion takes no dish, and then the episode ends"


def test_the_other_chef_does_something_else() -> None:
    both = [(STAY, NORTH), (STAY, INTERACT)]
    assert (next_interactions(ROOM, both, 1)[:, 0] == UNKNOWN).all()


def test_beyond_the_horizon_nothing_is_done() -> None:
    waits = [STAY] * INTENTION_HORIZON
    came = next_interactions(ROOM, actions(WEST, *waits, INTERACT), 0)
    assert came[0].tolist() == came[1].tolist() == list(NONE)
    assert came[2].tolist() == [InteractionKind.TAKE_ONION, 0, 1, INTENTION_HORIZON]


def test_a_hit_names_kind_and_station_and_only_what_came_counts() -> None:
    came = next_interactions(ROOM, actions(WEST, INTERACT, STAY), 0)
    right = Intention(InteractionKind.TAKE_ONION, 0, 1, 7, 0.9)
    elsewhere = Intention(InteractionKind.TAKE_ONION, 3, 1, 1, 0.9)
    assert hits(came, [right, elsewhere, right, right]) == (2, 1)
    assert hits(came, [right, None, None, None]) == (1, 1)


def test_intentions_are_stored_in_a_few_bytes_and_come_back() -> None:
    said = (Intention(7, 10, 12, 20, 0.5), Intention(0, -1, -1, 0, 0.25))
    blob = pack(said)
    assert unpack(blob) == said
    assert blob is not None
    assert len(blob) == 16
    assert pack(()) is None
    assert unpack(None) == ()
    for shown in ((8, -1, -1, 95), (4, 10, 3, 25), None):
        assert unpack_shown(pack_shown(shown)) == shown


@pytest.mark.parametrize("said", [(Intention(1, 0, 1, 2, 0.9),), ()])
def test_the_running_accuracy_counts_intentions_of_each_episode(
    database: Database, said: tuple[Intention, ...]
) -> None:
    def fill(connection):
        study = studies.register(connection, "one", "name: one")
        spec = replace(SPEC, grid=ROOM.text, layout="room", agents=("sp", None), watched_seat=0, horizon=2)
        episode = episodes.create(connection, episodes.NewEpisode(spec, "episode-01", (None, None), study.id, "tom"))
        joint = (None, *actions(WEST, INTERACT))
        records = [
            structs.replace(one, actions=done, intentions=said if one.timestep == 1 else ())
            for one, done in zip(played(episode, 2), joint, strict=True)
        ]
        ticks.insert(connection, records)
        episodes.end(connection, result_of(records, spec))
        return study.id

    accuracy = RunningAccuracy()
    database.read_now(accuracy.count, (database.write_now(fill),))
    (found,) = accuracy.hits.values()
    assert (found.intentions, found.intentions_right) == (len(said), len(said))
