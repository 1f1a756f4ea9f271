"""The readable parts of a bundle: the allocation list, the questions, the planned analysis, the README."""

import csv
import io
import json
from collections import Counter
from collections.abc import Iterator
from typing import Any

from analysis.data_quality import RULES
from analysis.groups import main_contrast
from analysis.study import QUESTIONNAIRE_LAYOUTS
from server.bundle.state import BundleState
from server.study.assignment import Count, StudyFullError, next_condition, participant_seed
from server.study.definition import Study
from server.study.factors import crossed
from server.study.questionnaire import AnyQuestion, Questionnaire, QuestionPage
from server.study.steps import has_rounds_for_two, steps

USUAL_PEOPLE = 30  # of a condition without a quota


def planned_people(study: Study) -> int:
    """Return how many participants the study plans for: the sum of its quotas, with a default where it has none."""
    return sum(condition.quota or USUAL_PEOPLE for condition in study.conditions)


def allocation(study: Study, people: int) -> str:
    """Return as CSV each participant's condition, seed and games, if nobody drops out. A replacement gets the next seed
    and the condition with the fewest participants."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(("participant", "condition", "seed", "episode", "layout", "agent", "episode_seed"))
    held: Counter[str] = Counter()
    for number in range(people):
        try:
            counts = {name: Count(completed=count) for name, count in held.items()}
            condition = next_condition(study, counts, number, unpaired=held if has_rounds_for_two(study) else None)
        except StudyFullError:
            break
        held[condition] += 1
        seed = participant_seed(study, number)
        for step in steps(study, condition, seed, number // len(study.conditions)):
            if step.kind == "episode":
                writer.writerow((number + 1, condition, seed, step.number, step.layout, step.agent, step.seed))
    return stream.getvalue()


def questions(study: Study) -> str:
    """Return all questions in all languages, as Markdown."""
    lines = [f"# Questions of {study.name}"]
    blocks: dict[str, QuestionPage] = {**({"quiz": study.quiz} if study.quiz else {}), **study.questionnaires}
    for key, block in blocks.items():
        after = ", after each episode" if key == study.after_episode else ""
        when = block.when if isinstance(block, Questionnaire) else None
        only = f", only after {' or '.join(when.one_of)} to `{when.question}`" if when else ""
        lines += ["", f"## {key}{after}{only}", ""]
        for question in block.asks:
            lines += _question(study, question)
    return "\n".join(lines) + "\n"


def _question(study: Study, question: AnyQuestion) -> Iterator[str]:
    asked = question.conditions if isinstance(question.conditions, str) else ", ".join(question.conditions)
    need = "required" if question.required else "may be left out"
    yield f"- `{question.key}` ({question.type}; {need}; conditions: {asked})"
    settings = question.model_dump(mode="json", exclude_none=True, exclude={"key", "type", "required", "conditions"})
    for language in study.languages:
        yield f"  - {language}: {question.text.of(language)}"
    rest = {name: value for name, value in settings.items() if name != "text"}
    yield f"  - {json.dumps(rest, ensure_ascii=False, sort_keys=True)}"


_TESTS = (
    "Kruskal-Wallis over conditions, per agent: conditions permuted over people, corrected over the agents "
    "(step-down minimum p); next to it as published, over episodes",
    "analysis of variance per layout",
    "t-tests per layout and agent over people, Benjamini-Hochberg within each comparison of two conditions",
    "whether main_comparison depends on layout or agent: conditions permuted over people, corrected over both",
    "t-tests of the questionnaire on questionnaire_layouts over people, Benjamini-Hochberg over all of them",
    "mixed model with participants as random effect: restricted maximum likelihood, Satterthwaite's degrees",
    "accuracy of the predictor with people, per layout and agent",
    "equivalence within smallest_effect: two one-sided Welch tests over people",
    "primary_test, else main_comparison, with exclusions undone and without flagged people; attrition",
    "cumulative-link mixed models of the questionnaire; Benjamini-Hochberg over all of them",
    "mixed model with cluster-robust errors, random slopes of the agent, and the round; simple effects",
)
_FACTORIAL = "factorial analysis of variance over people (type III): main effects, interactions, simple effects"


_OF_CONDITIONS = ("whether main_comparison", "equivalence within")  # beginnings of what blocks of rounds have not


def _tests(study: Study) -> list[str]:
    """Return the tests; with blocks of rounds, conditions are their orders, and there is no main comparison."""
    tests = [text for text in _TESTS if not (study.cells.within and text.startswith(_OF_CONDITIONS))]
    return [*tests, _FACTORIAL] if study.factors else tests


def _levels(study: Study) -> dict[str, dict[str, str]]:
    """Return the level of each factor, by condition; with blocks of rounds, by what is shown in one."""
    names = {condition.name for condition in study.displays}
    return {name: levels for name, levels in crossed(study.factors) if name in names}


def _blocks(study: Study) -> dict[str, list[str]]:
    """Return what is shown in each block of rounds, by condition; {} without blocks."""
    if study.blocks == 1:
        return {}
    return {condition.name: [seen.name for seen in condition.displays] for condition in study.conditions}


def planned_analysis(study: Study) -> dict[str, Any]:
    """Return what `kitchenmind report` will do with this study's data, fixed before data collection."""
    conditions = [condition.name for condition in study.conditions]
    layouts = [kitchen.name for kitchen in study.layouts]
    contrast = None if study.cells.within else main_contrast(conditions)
    return {
        "command": "kitchenmind report EXPORT",
        "measure": "reward: score plus credit for unfinished soups, per episode",
        "analysed": "episodes played to their end by people who finished; neither they nor anybody in them excluded",
        "conditions": conditions,
        "factors": {factor: list(levels) for factor, levels in study.factors.items()} or None,
        "levels_of_conditions": _levels(study) or None,
        "within": list(study.cells.within) or None,
        "blocks_of_conditions": _blocks(study) or None,
        "primary_test": study.primary.model_dump(mode="json") if study.primary else None,
        "smallest_effect": study.smallest_effect.model_dump(mode="json") if study.smallest_effect else None,
        "main_comparison": f"{contrast[0]} - {contrast[1]}" if contrast else None,
        "layouts": layouts,
        "agents": [agent.name for agent in study.agents],
        "questionnaire_layouts": layouts[:QUESTIONNAIRE_LAYOUTS],
        "tests": _tests(study),
        "quality_rules": [
            {
                "rule": rule.name,
                "meaning": rule.meaning,
                "look": rule.look,
                "drop": rule.drop,
                "bad_when": "low" if rule.low_is_bad else "high",
            }
            for rule in RULES
        ],
    }


def readme(study: Study, state: BundleState, people: int) -> str:
    """Return README.md for a reviewer who knows neither the study nor this software."""
    models = "\n".join(f"| {name} | `{digest}` |" for name, digest in state.models.items())
    return _README.format(
        name=study.name,
        title=study.title.of("en"),
        people=people,
        conditions=", ".join(condition.name for condition in study.conditions),
        seed=study.seed,
        version=state.code_version,
        files=len(state.code),
        models=models,
    )


_README = """# {title}

The study `{name}` as it was before the first participant: conditions {conditions}; seed {seed}; kitchenmind {version}.

| file | is |
|---|---|
| `study.yaml` | the study file, word for word: pages, questions, game, conditions, order |
| `layouts/` | every kitchen as drawn |
| `allocation.csv` | condition, seed and games of {people} participants, if nobody drops out |
| `questions.md` | all questions in all languages |
| `analysis.json` | the primary test, what else will be computed, and the rules that propose to leave an episode out |
| `plan.md` | the researchers' own words, where they gave some |
| `manifest.json` | SHA-256 of these files, of every kitchen and model, and of {files} files of the code |

`kitchenmind serve --bundle FILE` runs exactly this, and refuses where code, kitchens or weights are others.

| model | SHA-256 of its list of hashes |
|---|---|
{models}
"""
