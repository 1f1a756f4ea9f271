"""What is probably unintended in a study that is served, for its page in the dashboard."""

from server.study.loader import StudyFile
from server.study_doubts import doubts


def warnings_of(file: StudyFile) -> list[str]:
    """Return the warnings as sentences."""
    return [one.sentences for one in doubts(file)]
