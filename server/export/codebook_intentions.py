"""The columns of an export about intentions: the predicted, the shown and the actual ones."""

from server.export.codebook_columns import Column, code
from server.play.intentions import HORIZON, Intention

RANKS = (1, 2)
KIND_CODE = "0 none, 1 take_onion, 2 take_dish, 3 take_soup, 4 fill, 5 plate, 6 serve, 7 put_down"
PARTS = ("kind", "x", "y", "steps", "probability")
SHOWN_PARTS = ("kind", "x", "y", "opacity")
CAME_PARTS = ("kind", "x", "y", "steps")
_RANK = {1: "likeliest", 2: "second likeliest"}


def _predicted(rank: int) -> tuple[Column, ...]:
    name, which = f"intention_{rank}", _RANK[rank]
    return (
        code(
            f"{name}_kind",
            f"What the watched chef will do next, {which} on state t: {KIND_CODE} (within {HORIZON} timesteps); empty: "
            "not predicted.",
        ),
        code(f"{name}_x", "Column of its station, from 0; -1: none."),
        code(f"{name}_y", "Row of its station, from 0; -1: none."),
        Column(f"{name}_steps", "integer", "In how many timesteps it is done; 1: in t; 0: none.", "timesteps", bits=16),
        Column(f"{name}_probability", "number", "Predicted probability of this kind at this station.", bits=32),
    )


INTENTION_COLUMNS = (
    *_predicted(1),
    *_predicted(2),
    code("displayed_intention_kind", "Intention drawn on state t; 8: nothing; empty: the condition draws none."),
    code("displayed_intention_x", "Column of the drawn intention's station; -1: none."),
    code("displayed_intention_y", "Row of the drawn intention's station; -1: none."),
    Column("displayed_intention_opacity", "integer", "Opacity of the drawn intention.", "%", bits=16),
    code(
        "interaction_kind",
        f"What the watched chef did next from t on, within {HORIZON} timesteps: the codes of `intention_1_kind`; "
        "empty: no intention was predicted in the episode, or it ended before this could be said.",
    ),
    code("interaction_x", "Column of the station that it used; -1: none."),
    code("interaction_y", "Row of the station that it used; -1: none."),
    Column(
        "interaction_steps", "integer", "In how many timesteps that was done; 1: in t; 0: none.", "timesteps", bits=16
    ),
)


def intentions_of(row: dict[str, object]) -> dict[str, object]:
    """Return the intentions of a row of an export as fields of TickRecord. Older exports have none."""
    predicted = [[row.get(f"intention_{rank}_{part}") for part in PARTS] for rank in RANKS]
    shown = tuple(row.get(f"displayed_intention_{part}") for part in SHOWN_PARTS)
    return {
        "intentions": tuple(Intention(*values) for values in predicted if values[0] is not None),  # type: ignore[arg-type]
        "displayed_intention": None if shown[0] is None else shown,
    }


def intentions_of_last(last: dict[str, object]) -> dict[str, object]:
    """Return the same from the JSON of an episode's last state."""
    shown = last.get("displayed_intention")
    return {
        "intentions": tuple(Intention(**values) for values in last.get("intentions", ())),  # type: ignore[attr-defined]
        "displayed_intention": tuple(shown) if shown is not None else None,  # type: ignore[arg-type]
    }
