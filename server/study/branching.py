"""Pages and questions that are only shown after a certain answer on an earlier page. Pure."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field

from server.study.strict_model import StrictModel

EarlierAnswers = Mapping[str, Mapping[str, Any]]  # step key -> question key -> answer


class When(StrictModel):
    """Show it only after one of these answers on an earlier page. Participants who were not asked, or gave no answer,
    do not get it."""

    question: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,39}$", examples=["plays"])]
    """The key of a choice, multiple or scale question in a questionnaire that comes earlier in `flow`."""
    one_of: Annotated[tuple[str, ...], Field(min_length=1, examples=[["often"]])]
    """The answers that lead here: values of options, or numbers of the scale. Of several chosen options, one is
    enough."""

    def holds(self, earlier: EarlierAnswers | None) -> bool:
        """Return whether one of the answers was given. None: there are no answers, as in a preview, and everything is
        shown."""
        if earlier is None:
            return True
        given = next((page[self.question] for page in earlier.values() if self.question in page), None)
        return any(str(value) in self.one_of for value in (given if isinstance(given, list) else [given]))
