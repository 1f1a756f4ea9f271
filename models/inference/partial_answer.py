"""What the workers have answered about one question so far: agent and predictor may be in different workers."""

from collections.abc import Sequence

from msgspec import Struct

from models.inference.answer_arrays import AnswerArrays
from models.inference.wire import Answer
from models.protocols import Decision, Intention, Question
from overcooked.constants import STAY


class PartialAnswer(Struct, gc=False):
    """The parts of a `Decision` that have come."""

    action: int | None = None
    probabilities: tuple[float, ...] = ()
    prediction: tuple[tuple[float, ...], ...] = ()
    intentions: tuple[Intention, ...] = ()

    def decision(self, question: Question) -> Decision | None:
        """Return the decision, None if what was asked has not come."""
        if question.agent is not None:
            if self.action is None:
                return None
            return Decision(self.action, self.probabilities, self.prediction, self.intentions)
        return Decision(STAY, (), self.prediction, self.intentions) if self.prediction else None


def read_answer(found: Sequence[PartialAnswer], answer: Answer) -> None:
    """Put a worker's answer, which has a row for each of `found`, into them."""
    arrays = AnswerArrays.read(answer)
    acted, action_distributions = arrays.acted.tolist(), arrays.action_distributions.tolist()
    predictions, intentions = arrays.predictions.tolist(), arrays.intentions.tolist()
    for k, part in enumerate(found):
        if acted[k] >= 0:
            part.action, part.probabilities = acted[k], tuple(action_distributions[k])
        if arrays.predicted[k]:
            part.prediction = tuple(map(tuple, predictions[k]))
            part.intentions = tuple([Intention(*intention) for intention in intentions[k] if intention[-1]])
