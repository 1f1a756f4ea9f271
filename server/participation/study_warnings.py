"""What is probably unintended in a study that is served, for its page in the dashboard."""

from server.prediction_warnings import prediction_warnings
from server.study.loader import StudyFile


def warnings_of(file: StudyFile) -> list[str]:
    """Return the warnings as sentences."""
    return [one.sentences for one in prediction_warnings(file)]
