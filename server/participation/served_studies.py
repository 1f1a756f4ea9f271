"""The studies that are served, and every version to which somebody has consented."""

import logging
from collections.abc import Iterable

from sqlalchemy import Connection

from server.store import answers
from server.store import studies as stored_studies
from server.store.database import Database
from server.store.participants import Participant
from server.study.branching import EarlierAnswers
from server.study.definition import Study
from server.study.loader import StudyError, StudyFile, parse_study
from server.study.steps import StudyStep, steps

log = logging.getLogger(__name__)


class Studies:
    """Studies by name (new participants) and by the number of their version (those who are in one)."""

    def __init__(self) -> None:
        self._open: dict[str, int] = {}
        self._versions: dict[int, Study] = {}
        self._unreadable: set[int] = set()

    @classmethod
    async def opened(cls, database: Database, files: Iterable[StudyFile]) -> "Studies":
        """Register the files and read all earlier versions back."""
        studies = cls()
        for file in files:
            row = await database.write(stored_studies.register, file.study.name, file.text)
            studies._open[file.study.name] = row.id
            studies._versions[row.id] = file.study
        await database.read(studies.learn)
        return studies

    async def add(self, database: Database, file: StudyFile) -> int:
        """Store a version without opening it to participants; return its number. Raises DatabaseDown."""
        row = await database.write(stored_studies.register, file.study.name, file.text)
        self._versions = self._versions | {row.id: file.study}
        return row.id

    def let_into(self, name: str, number: int) -> None:
        """Let new participants into this version of a study from now on."""
        self._open[name] = number

    def learn(self, connection: Connection) -> None:
        """Read versions that are not loaded here: earlier ones, and those that other processes serve."""
        found: dict[int, Study] = {}
        for row in stored_studies.every(connection):
            if row.id in self._versions or row.id in self._unreadable:
                continue
            try:
                found[row.id] = parse_study(row.source, f"{row.key} version {row.version}").study
            except StudyError as error:
                self._unreadable.add(row.id)
                log.warning("version %d of %s can no longer be read: %s", row.version, row.key, error)
        self._versions = self._versions | found  # a new one: the event loop may be reading it

    def can_read(self, connection: Connection, study_id: int) -> bool:
        """Return whether this version can be read, also if another process has opened it since."""
        if study_id not in self._versions:
            self.learn(connection)
        return study_id in self._versions

    def names(self) -> tuple[str, ...]:
        """Return the studies that take new participants, in the order given."""
        return tuple(self._open)

    def open(self, name: str) -> tuple[int, Study] | None:
        """Return the version that takes new participants: its number in the database, and the study."""
        number = self._open.get(name)
        return None if number is None else (number, self._versions[number])

    def version(self, study_id: int) -> Study | None:
        """Return the study as it was when somebody consented."""
        return self._versions.get(study_id)

    def versions(self, name: str) -> tuple[int, ...]:
        """Return the numbers of all versions of a study, newest first."""
        return tuple(sorted((number for number, study in self._versions.items() if study.name == name), reverse=True))

    def every_version(self) -> tuple[int, ...]:
        """Return the numbers of all versions of all studies."""
        return tuple(self._versions)

    def of(self, participant: Participant) -> Study:
        """Return the study that the participant is in. Raises KeyError when its version can no longer be read."""
        return self._versions[participant.study_id]

    def steps_of(self, participant: Participant) -> tuple[StudyStep, ...]:
        """Return all steps of the participant."""
        study = self.of(participant)
        # Conditions fill in turn, so counting per condition spreads the rows of a Latin square evenly over each.
        number = (participant.allocation_number - 1) // len(study.conditions)
        return steps(study, participant.condition, participant.seed, number)

    async def earlier_answers(self, database: Database, participant: Participant) -> EarlierAnswers | None:
        """Return the answers on which pages and questions may depend; none are read for a study without branches."""
        if not self.of(participant).branches:
            return {}
        return await database.read(answers.of_participant, participant.id)

    def step(self, participant: Participant) -> StudyStep:
        """Return the participant's current step; the last one for those who finished."""
        sequence = self.steps_of(participant)
        return sequence[min(participant.position, len(sequence) - 1)]
