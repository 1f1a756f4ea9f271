"""Load the studies that a server is given, and leave out or refuse those that cannot be played."""

import logging
from functools import partial

from server.participation.own_kitchens import keep_own_models, load_with_kitchens
from server.required_models import required_models
from server.settings import Settings
from server.store import kitchens
from server.study.loader import StudyError, StudyFile
from server.study.own_languages import LanguageError, use_languages_next_to
from server.study_check import missing_problems

log = logging.getLogger(__name__)


def playable_studies(settings: Settings) -> list[StudyFile]:
    """Return the studies that can be played; studies that are opened in the dashboard have the languages of the data
    folder. Raises StudyError for an invalid file or a missing agent or predictor; if there are several studies in local
    mode, those without their models are left out instead."""
    try:
        use_languages_next_to(settings.data)
    except LanguageError as error:
        raise StudyError(error.lines) from None
    served, reasons = [], []
    for path in settings.studies:
        grids = partial(kitchens.grids_at, settings.database)
        file = load_with_kitchens(path, grids, settings.models_folder, settings.own_models)
        missing = [file.describe(problem) for problem in missing_problems(file, required_models([file]))]
        missing = missing or _not_kept(file)
        reasons += missing
        if not missing:
            served.append(file)
    if reasons and (not served or settings.mode == "production"):
        raise StudyError(reasons)
    for reason in reasons:
        log.warning("a study is not served: %s", reason)
    return served


def _not_kept(file: StudyFile) -> list[str]:
    """Copy the study's trained models before they are loaded: what is loaded again later must be the same. Return why
    that failed."""
    try:
        keep_own_models(file)
    except StudyError as error:
        return list(error.lines)
    return []
