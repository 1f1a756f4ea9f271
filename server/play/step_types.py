"""The types of a participant's steps as JSON: what a program gets that asks for a page with `Accept: application/json`.

The game itself has messages of its own (`messages.py`).
"""

from typing import Literal

from msgspec import Struct

StepName = Literal[
    "choose", "consent", "welcome_back", "introduction", "page", "questionnaire", "quiz", "ready", "break", "game",
    "thanks", "ended", "other",
]  # fmt: skip
StepFieldType = Literal["hidden", "check", "scale", "choice", "multiple", "text", "number", "ranking"]


class StepOption(Struct):
    """One of several things to choose."""

    value: str
    text: str


class StepField(Struct, omit_defaults=True):
    """One field of a form. `hidden`: send it back as it is. `check`: a box; send its value if it is ticked. `ranking`:
    a field NAME.OPTION for each option, with its place from 1. `scale`: a number from `low` to `high` in steps of
    `step`; `labels` are the words of its ends, or of all points."""

    name: str
    type: StepFieldType
    value: str = ""
    label: str = ""
    hint: str = ""
    required: bool = False
    options: list[StepOption] = []
    low: float | None = None
    high: float | None = None
    step: int = 1
    whole: bool = False
    most: int | None = None
    labels: list[str] = []
    fault: str = ""


class StepForm(Struct):
    """The form of a page: POST its fields to `action`, as JSON or as a form. All hidden fields must come back."""

    action: str
    fields: list[StepField]


class StepText(Struct):
    """A piece of a page; `body` is Markdown."""

    title: str
    body: str


class StepGame(Struct):
    """The page is a game: play it on the websocket at this path, then ask for the page again."""

    socket: str
    kind: Literal["tutorial", "episode"]
    lessons: list[str]


class StepEnd(Struct, omit_defaults=True):
    """How the participation ended. `code`: for the recruiter; `own_code`: of this participant alone. `back`: where a
    browser goes then, with `back_fields` as a form if there are some."""

    kind: Literal["completed", "screened_out", "inattentive", "withdrawn", "timed_out", "unpaired"]
    code: str = ""
    own_code: str = ""
    back: str = ""
    back_fields: dict[str, str] = {}


class OfferedStudy(Struct):
    """A study that takes participants; `path` is its consent page."""

    name: str
    title: str
    summary: str
    path: str


class StepPage(Struct, omit_defaults=True):
    """One page of a participant. `page`: its kind; `template`: its name where the kind is `other`."""

    page: StepName
    language: str
    template: str = ""
    study: str = ""
    step: str = ""
    title: str = ""
    lead: str = ""
    texts: list[StepText] = []
    form: StepForm | None = None
    game: StepGame | None = None
    end: StepEnd | None = None
    studies: list[OfferedStudy] = []
