"""An agent from outside whose faults are errors that name the agent, the place in its code and the remedy."""

import traceback
from pathlib import Path

from models.inference.checked_output import WrongOutput, checked_probabilities
from models.protocols import BlackBoxError, Observations, Policy, Probabilities

_HERE = Path(__file__).parent


class CheckedPolicy:
    """Ask an agent and check every answer. Without the check, NaN or negative probabilities would still give actions,
    but wrong ones."""

    def __init__(self, policy: Policy, name: str) -> None:
        self._policy, self._name = policy, name

    def probabilities(self, observations: Observations) -> Probabilities:
        """Return the agent's probabilities. Raises BlackBoxError if it fails or its answer is not probabilities."""
        try:
            return checked_probabilities(self._policy.probabilities(observations), len(observations))
        except BlackBoxError:
            raise
        except WrongOutput as error:
            raise BlackBoxError(f"{self._name} {error}. See docs/guides/bring_your_own_agent.md.") from None
        except Exception as error:
            raise BlackBoxError(f"{self._name} failed: {explained(error)}. Correct its code.") from error


def explained(error: BaseException) -> str:
    """Return an error of somebody else's code as `RuntimeError: no weights (agent.py, line 12)`. The place is the last
    one that is neither here nor in an installed package; there may be none."""
    frames = traceback.extract_tb(error.__traceback__)
    theirs = [one for one in frames if "site-packages" not in one.filename and _HERE not in Path(one.filename).parents]
    has_place = theirs and not isinstance(error, SyntaxError)  # whose text says it
    place = f" ({Path(theirs[-1].filename).name}, line {theirs[-1].lineno})" if has_place else ""
    words = " ".join(str(error).split())
    return f"{type(error).__name__}{': ' if words else ''}{words}{place}"
