"""Check that the values of a study file fit together. Pure: yields problems."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from pydantic import BaseModel

from server.study.assignment import participant_seed
from server.study.definition import FIXED_PAGES, Condition, Study
from server.study.locale import languages, refusal
from server.study.published_scales import scale_languages
from server.study.questionnaire import (
    ChoiceQuestion,
    MultipleQuestion,
    PublishedScale,
    QuestionPage,
    RankingQuestion,
    asked,
    questions_of,
)
from server.study.quick_fixes import QuickFix, insert, keep_only, leave_out, write
from server.study.steps import episodes_of, episodes_of_a_block, order_of_all_blocks
from server.study.text import Text

TOGETHER: Final = "all"

Path = tuple[str | int, ...]


@dataclass(frozen=True)
class Problem:
    """A problem at a place of the file. A warning does not prevent serving the study. `fix`: what the study builder
    offers, where one small change solves it."""

    path: Path
    reason: str
    remedy: str
    warning: bool = False
    fix: QuickFix | None = None

    @property
    def sentences(self) -> str:
        """Reason and remedy as they stand in a text of their own."""
        return f"{capitalised(self.reason)}. {self.remedy}"


def capitalised(words: str) -> str:
    """Return the words as the beginning of a sentence; names in it keep their capitals."""
    return words[:1].upper() + words[1:]


def problems(study: Study) -> Iterator[Problem]:
    """Yield everything wrong with a study whose single values are valid."""
    yield from _missing_translations(study, study.languages)
    yield from _names(study)
    yield from _flow(study)
    yield from _conditions(study)
    for key, questionnaire in study.questionnaires.items():
        yield from _questions(study, questionnaire, ("questionnaires", key))
    if study.quiz:
        yield from _questions(study, study.quiz, ("quiz",))
        if not any(isinstance(question, ChoiceQuestion) and question.correct for question in study.quiz.asks):
            yield Problem(
                ("quiz",), "no question of the quiz has a correct answer", "Add `correct:` to its choice questions."
            )
    yield from _attention(study)
    yield from _episodes(study)
    yield from _two_people(study)


def balance(study: Study, participants: int = 60) -> dict[str, Counter[tuple[str, int]]]:
    """Count how often each layout and agent is at each position, over simulated participants, by (name, position from
    0)."""
    layouts: Counter[tuple[str, int]] = Counter()
    agents: Counter[tuple[str, int]] = Counter()
    for number in range(participants):
        row = number // len(study.conditions)  # the number within the condition
        for place, (layout, agent) in enumerate(order_of_all_blocks(study, participant_seed(study, number), row)):
            layouts[layout, place] += 1
            agents[agent, place] += 1
    return {"layout": layouts, "agent": agents}


def _missing_translations(part: Any, languages: tuple[str, ...], path: Path = ()) -> Iterator[Problem]:
    if isinstance(part, Text):
        for language in part.missing(languages):
            yield Problem(
                path, f"no words in {language!r}", f"Add `{language}: ...`, or take {language!r} out of `languages`."
            )
    elif isinstance(part, BaseModel):
        for name in sorted(part.model_fields_set):  # defaults are translated by the platform
            yield from _missing_translations(getattr(part, name), languages, (*path, name))
    elif isinstance(part, dict):
        for key, value in part.items():
            yield from _missing_translations(value, languages, (*path, key))
    elif isinstance(part, tuple):
        for index, value in enumerate(part):
            yield from _missing_translations(value, languages, (*path, index))


def _names(study: Study) -> Iterator[Problem]:
    for block in ("conditions", "agents", "layouts"):
        names = [part.name for part in getattr(study, block)]
        for index, name in enumerate(names):
            if name in names[:index]:
                yield Problem((block, index, "name"), f"{name!r} occurs twice", "Give each its own name.")
            if name == TOGETHER:
                reason = f"reports call all {block} together {TOGETHER!r}"
                yield Problem((block, index, "name"), reason, "Choose another name.")
    yield from _unknown_languages(study.languages)
    if len(set(study.languages)) < len(study.languages):
        yield Problem(("languages",), "a language occurs twice", "Name each once.")
    for key in study.questionnaires:
        if key in study.pages or key in FIXED_PAGES:
            yield Problem(("questionnaires", key), f"{key!r} also names a page", "Give the questionnaire another key.")
    for key in study.pages:
        if key in FIXED_PAGES:
            yield Problem(("pages", key), f"{key!r} is a built-in page", "Give the page another key.")


def _unknown_languages(wanted: tuple[str, ...]) -> Iterator[Problem]:
    for language in wanted:
        if reason := refusal(language):
            words = f"the file of the platform's words in {language!r} cannot be used: {reason.rstrip('.')}"
            yield Problem(("languages",), words, "Until you correct it, the words stay as they were.", warning=True)
        elif language not in languages():
            reason = f"the platform itself has no words in {language!r}: its buttons will be English"
            made = f"`kitchenmind study words {language}` makes locales/{language}.yaml next to the study"
            remedy = (
                f"{made}, which you translate. For a draft in the dashboard, append the server's data folder to the "
                "command."
            )
            yield Problem(("languages",), reason, remedy, warning=True)


def _flow(study: Study) -> Iterator[Problem]:
    known = [*FIXED_PAGES, *study.pages, *study.questionnaires]
    for index, entry in enumerate(study.flow):
        fix = leave_out(f"Take {entry} out of the flow", ("flow", index))
        if entry not in known:
            yield Problem(("flow", index), f"there is no page {entry!r}", f"Known: {', '.join(known)}.", fix=fix)
        if entry in study.flow[:index]:
            remedy = "Each page comes once; copy it under another key."
            yield Problem(("flow", index), f"{entry!r} comes twice", remedy, fix=fix)
    if study.flow[-1] != "thanks":
        yield Problem(
            ("flow",), "`flow` does not end with thanks", "Make `thanks` the last entry: it gives the completion code."
        )
    if "quiz" in study.flow and study.quiz is None:
        yield Problem(("flow", study.flow.index("quiz")), "there is no quiz block", "Add `quiz:` with its questions.")
    if study.quiz is not None and "quiz" not in study.flow:
        yield Problem(("quiz",), "the quiz is not in `flow`", "Add `quiz` to `flow`, or remove the block.")
    for block, keys in (("pages", study.pages), ("questionnaires", study.questionnaires)):
        for key in keys:
            if key not in study.flow and key != study.after_episode:
                fix = insert(f"Put {key} before the last page", ("flow",), len(study.flow) - 1, key)
                yield Problem((block, key), f"nobody reaches {key!r}", "Add it to `flow`, or remove it.", fix=fix)
    if study.after_episode and study.after_episode not in study.questionnaires:
        yield Problem(
            ("after_episode",), f"there is no questionnaire {study.after_episode!r}", "Name one of `questionnaires`."
        )


def _conditions(study: Study) -> Iterator[Problem]:
    for index, condition in enumerate(study.displays):
        if (condition.predictor == "degraded") != (condition.accuracy is not None):
            reason = "`accuracy` and `predictor: degraded` belong together"
            yield Problem(
                ("conditions", index), reason, "Set `accuracy: 0.5` next to `predictor: degraded`, or remove it."
            )


def _questions(study: Study, questionnaire: QuestionPage, path: Path) -> Iterator[Problem]:
    taken: set[str] = set()
    conditions = {condition.name for condition in (*study.conditions, *study.displays)}
    for index, question in enumerate(questionnaire.questions):
        place = (*path, "questions", index)
        keys = [one.key for one in questions_of(question)]
        if twice := [key for key in keys if key in taken]:
            yield Problem((*place, "key"), f"{twice[0]!r} occurs twice", "Give each question its own key.")
        taken.update(keys)
        if isinstance(question.conditions, tuple):
            yield from _unknown_conditions(question.conditions, conditions, (*place, "conditions"))
        if isinstance(question, PublishedScale):
            yield from _scale_languages(study, question, (*place, "scale"))
        if isinstance(question, ChoiceQuestion | MultipleQuestion | RankingQuestion):
            values = [option.value for option in question.options]
            if len(set(values)) < len(values):
                yield Problem((*place, "options"), "two options have the same value", "Give each its own value.")


def _unknown_conditions(names: tuple[str, ...], known: set[str], path: Path) -> Iterator[Problem]:
    left = [name for name in names if name in known]
    label = f"Ask in {', '.join(left)} only" if left else "Ask in all conditions"
    for name in set(names) - known:
        remedy = f"Known: {', '.join(sorted(known))}."
        yield Problem(path, f"there is no condition {name!r}", remedy, fix=keep_only(label, path, left))


def _scale_languages(study: Study, entry: PublishedScale, path: Path) -> Iterator[Problem]:
    for language in study.languages:
        if language not in scale_languages(entry.scale):
            remedy = f"Write its items out as questions of your own, or take {language!r} out of `languages`."
            yield Problem(path, f"{entry.scale} has no words in {language!r}", remedy)


def _attention(study: Study) -> Iterator[Problem]:
    """Check that participants get at least as many attention checks as lead to screening out."""
    limit = study.attention.screen_out_after
    if limit is None:
        return
    count = min(_attention_checks(study, condition.name) for condition in study.conditions)
    if limit > count:
        reason = f"nobody can fail {limit} attention checks: the study asks {count}"
        remedy = "Add `attention:` to more scale or choice questions, or lower it."
        yield Problem(("attention", "screen_out_after"), reason, remedy)


def _attention_checks(study: Study, condition: str) -> int:
    """Return how many attention checks a participant in this condition gets."""
    arm = study.condition(condition)

    def of(key: str, seen: Condition = arm) -> int:
        questions = asked(study.questions(key), seen.name, study.shows_predictions(seen))
        return sum(getattr(question, "attention", None) is not None for question in questions)

    pages = [entry for entry in study.flow if entry in study.questionnaires or (entry == "quiz" and study.quiz)]
    after = study.after_episode if study.after_episode in study.questionnaires else None
    rounds = sum(of(after, seen) for seen in arm.displays) if after else 0
    return sum(map(of, pages)) + rounds * episodes_of(study) // study.blocks


def _episodes(study: Study) -> Iterator[Problem]:
    yield from _breaks(study, episodes_of_a_block(study) * study.blocks)
    if study.order.rule == "paper" and len(study.agents) != 2:
        remedy = "List two agents, or use `latin_square`."
        fix = write("Use latin_square", ("order", "rule"), "latin_square")
        yield Problem(("order", "rule"), "the paper's rule alternates two agents", remedy, fix=fix)
    if study.game.deadline_ms >= study.game.tick_ms:
        yield Problem(
            ("game", "deadline_ms"), "the models' deadline is longer than the tick", "Make it shorter than `tick_ms`."
        )
    if study.game.pause.each_s > study.game.pause.episode_s:
        yield Problem(
            ("game", "pause"), "one pause may last longer than all together", "Make `episode_s` at least `each_s`."
        )


def _breaks(study: Study, count: int) -> Iterator[Problem]:
    """Check that each break lies between two of `count` episodes: fewer kitchens or agents are fewer episodes."""
    left = [number for number in study.breaks.after if 1 <= number < count]
    label = "Leave this break out" if len(left) + 1 == len(study.breaks.after) else "Leave these breaks out"
    fix = keep_only(label, ("breaks", "after"), left)
    for index, number in enumerate(study.breaks.after):
        if number not in left:
            remedy = f"Use 1 to {count - 1}." if count > 1 else "Leave `breaks.after` empty: the study has one episode."
            reason = f"there is no break after episode {number}"
            yield Problem(("breaks", "after", index), reason, remedy, fix=fix)


def _two_people(study: Study) -> Iterator[Problem]:
    if study.tutorial.agent.human:
        yield Problem(("tutorial", "agent"), "the practice is for one person", "Name an agent, such as `guide`.")
    if study.waiting_room.agent.human:
        yield Problem(
            ("waiting_room", "agent"), "a person cannot stand in for one", "Name an agent, such as `planner`."
        )
    for index, agent in enumerate(study.agents):
        if not agent.human:
            continue
        if agent.model is not None or agent.mode != "card":
            reason = "a person has neither `model` nor `mode`"
            yield Problem(("agents", index), reason, "Remove them, or remove `human: true`.")
        if study.order.rule != "fixed":
            reason = "two people have to come to the same round at the same time"
            remedy = "Use `rule: fixed` where an agent is `human: true`."
            fix = write("Use fixed", ("order", "rule"), "fixed")
            yield Problem(("order", "rule"), reason, remedy, fix=fix)
        if agent.predictor is None and any(map(study.shows_predictions, study.conditions)):
            reason = "marks are to be shown, but there is no predictor for a person"
            remedy = "Add `predictor:`, e.g. that of an agent who plays much like people: `fcp_predictor_stream`."
            yield Problem(("agents", index), reason, remedy)
