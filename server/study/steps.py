"""The sequence of steps of one participant after consent. Pure functions of the study and a seed."""

from dataclasses import dataclass, replace
from typing import Literal

from server.study.definition import Study
from server.study.order import derived_seed, episode_order

Kind = Literal["introduction", "quiz", "questionnaire", "page", "tutorial", "ready", "episode", "break", "thanks"]
Phase = Literal["consent", "introduction", "practice", "rounds", "finish"]
PHASES: tuple[Phase, ...] = ("consent", "introduction", "practice", "rounds", "finish")
GAMES: tuple[Kind, ...] = ("tutorial", "episode")


@dataclass(frozen=True)
class StudyStep:
    """One step of a participant. `key` is unique among the steps and never changes."""

    key: str
    kind: Kind
    phase: Phase
    page: str = ""  # the study's page or questionnaire that is shown
    number: int = 0  # of the episode, from 1: the one that this step is, prepares or follows
    layout: str = ""
    agent: str = ""
    seed: int = 0  # of the episode
    block: int = 0  # of rounds, from 1, in which the step lies; 0: outside of the rounds, or the study has no blocks

    @property
    def is_game(self) -> bool:
        return self.kind in GAMES

    @property
    def asks(self) -> str:
        """The questionnaire (or `quiz`) whose questions this step asks; empty if it asks none."""
        return "quiz" if self.kind == "quiz" else self.page if self.kind == "questionnaire" else ""


def has_rounds_for_two(study: Study) -> bool:
    """Return whether participants play rounds with each other."""
    return any(agent.human for agent in study.agents)


def step_address(study: str) -> str:
    """Return the address at which every step of a study is shown and submitted."""
    return f"/s/{study}/now"


def steps(study: Study, condition: str, seed: int, number: int = 0) -> tuple[StudyStep, ...]:
    """Return the steps of the participant with this seed, the `number`-th (from 0) in the condition. Raises KeyError
    for an unknown condition. The condition does not affect the order of the rounds, only what is drawn and asked."""
    study.condition(condition)
    sequence: list[StudyStep] = []
    for entry in study.flow:
        if entry == "episodes":
            sequence.extend(_episodes(study, seed, number))
        elif entry == "tutorial":
            sequence.append(StudyStep("tutorial", "tutorial", "practice", seed=derived_seed(seed, "tutorial")))
        else:
            sequence.append(_page(study, entry, _phase(study, entry)))
    return tuple(sequence)


def episodes_of(study: Study) -> int:
    """Return how many episodes each participant plays."""
    return study.blocks * episodes_of_a_block(study) if "episodes" in study.flow else 0


def episodes_of_a_block(study: Study) -> int:
    """Return how many episodes a block of rounds has; without blocks, all of them."""
    return len(study.layouts) * len(study.agents) * study.order.repeat


def position(sequence: tuple[StudyStep, ...], key: str) -> int:
    """Return the index of a step. Raises KeyError for a key that is not among these steps."""
    for index, step in enumerate(sequence):
        if step.key == key:
            return index
    raise KeyError(key)


def _episodes(study: Study, seed: int, number: int) -> list[StudyStep]:
    sequence: list[StudyStep] = []
    order = order_of_all_blocks(study, seed, number)
    for turn, (layout, agent) in enumerate(order, start=1):
        block = block_of(study, turn)
        step = StudyStep("", "ready", "rounds", number=turn, layout=layout, agent=agent, block=block)
        name = f"{turn:02d}"
        sequence.append(replace(step, key=f"ready-{name}"))
        sequence.append(replace(step, key=f"episode-{name}", kind="episode", seed=derived_seed(seed, "episode", turn)))
        if study.after_episode:
            key = f"{study.after_episode}-{name}"
            sequence.append(replace(step, key=key, kind="questionnaire", page=study.after_episode))
        if turn in study.breaks.after and turn < len(order):
            sequence.append(StudyStep(f"break-{name}", "break", "rounds", number=turn, block=block))
    return sequence


def order_of_all_blocks(study: Study, seed: int, number: int) -> tuple[tuple[str, str], ...]:
    """Return the layout and agent of each episode of a participant, block after block."""
    order = episode_order(study, seed, number)
    for later in range(1, study.blocks):
        order += episode_order(study, derived_seed(seed, "block", later), number)
    return order


def block_of(study: Study, number: int) -> int:
    """Return the block of rounds of an episode, from 1; 0 in a study without blocks."""
    return (number - 1) // episodes_of_a_block(study) + 1 if study.blocks > 1 else 0


def _page(study: Study, entry: str, phase: Phase) -> StudyStep:
    if entry in ("introduction", "quiz", "thanks"):
        return StudyStep(entry, entry, phase)  # type: ignore[arg-type]
    kind: Kind = "questionnaire" if entry in study.questionnaires else "page"
    return StudyStep(entry, kind, phase, entry)


def _phase(study: Study, entry: str) -> Phase:
    """Return the part of the progress bar for a page, from what comes before it."""
    before = study.flow[: study.flow.index(entry)]
    if entry == "thanks" or "episodes" in before:
        return "finish"
    return "practice" if "tutorial" in before else "introduction"
