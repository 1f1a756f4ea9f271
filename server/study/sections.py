"""The sections of a study file: of the study builder's form and of the reference, in this order."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class StudySection:
    """Keys at the top of a study file that belong together."""

    name: str  # in addresses and file names
    title: str
    keys: tuple[str, ...]


SECTIONS: Final = (
    StudySection(
        "title",
        "Title and languages",
        ("name", "title", "summary", "languages", "contact", "duration_min", "seed"),
    ),
    StudySection(
        "conditions", "Conditions, agents and predictor", ("factors", "cells", "conditions", "agents", "predictor")
    ),
    StudySection("kitchens", "Kitchens and order", ("layouts", "order", "breaks")),
    StudySection("pages", "Steps and pages", ("flow", "pages", "debriefing")),
    StudySection("consent", "Consent page", ("consent",)),
    StudySection("questionnaires", "Questionnaires", ("questionnaires", "after_episode", "quiz", "attention")),
    StudySection("recruitment", "Recruitment", ("recruitment", "entry")),
    StudySection(
        "game", "Timing and game", ("timeout_min", "hold_min", "replace_excluded", "game", "tutorial", "waiting_room")
    ),
    StudySection("analysis", "Planned analysis", ("primary", "smallest_effect")),
    StudySection("models", "Models of your own", ("checkpoints",)),
)
