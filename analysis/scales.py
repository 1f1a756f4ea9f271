"""Published scales that a study uses by name: a score for each subscale and page, and how reliable it is.

The files of the scales say which items are reversed. They are read from where the server reads the questions.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import yaml

from analysis.compare import adjust, mean_row, t_test
from analysis.declared import study_files
from analysis.groups import Values, pairs
from analysis.results import Result
from analysis.tables import Export

SCALES = Path(__file__).parent.parent / "server" / "study" / "scales"
SECTION = "scale"
MIN_PEOPLE = 3  # for a reliability
SCORES = {
    **dict.fromkeys(("participant", "condition", "step", "episode", "questionnaire", "scale", "subscale"), pl.String),
    "score": pl.Float64, "answered": pl.Int64, "items": pl.Int64,
}  # fmt: skip


@dataclass(frozen=True)
class Subscale:
    """The items that are scored together. `total`: a reversed item counts as `total` minus the answer."""

    scale: str
    name: str
    title: str
    items: Mapping[str, bool]  # question -> reversed
    total: int


@cache
def subscales(scale: str) -> tuple[Subscale, ...]:
    """Return the subscales of a scale, none for an unknown one."""
    path = SCALES / f"{scale}.yaml"
    if not re.fullmatch(r"[a-z0-9_]+", scale) or not path.is_file():
        return ()
    published = yaml.safe_load(path.read_text(encoding="utf-8"))
    total = 2 * published["first"] + published["step"] * (published["points"] - 1)
    found = []
    for name, title in published["subscales"].items():
        items = {item["key"]: bool(item.get("reverse")) for item in published["items"] if item["subscale"] == name}
        whole = published["title"] if len(published["subscales"]) == 1 else f"{published['title']}: {title}"
        found.append(Subscale(scale, name, whole, items, total))
    return tuple(found)


def scale_title(question: str) -> str:
    """Return the name of a row's subscale; `question` is questionnaire/scale/subscale."""
    _, scale, name = question.split("/")
    return next(one.title for one in subscales(scale) if one.name == name)


def used_scales(export: Export) -> dict[str, tuple[str, ...]]:
    """Return the scales of each questionnaire, as the study files in the export name them."""
    used: dict[str, dict[str, None]] = {}
    for text, _ in study_files(export).values():
        for key, block in _mapping(text.get("questionnaires")).items():
            entries = block.get("questions") if isinstance(block, dict) else None
            for entry in entries if isinstance(entries, list) else ():
                if isinstance(entry, dict) and entry.get("type") == "published":
                    used.setdefault(key, {})[str(entry.get("scale"))] = None
    return {key: tuple(names) for key, names in used.items()}


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def without_items(answers: pl.DataFrame, used: Mapping[str, Sequence[str]]) -> pl.DataFrame:
    """Return the answers to other questions: items of a scale count in its score and not one by one."""
    items = [item for names in used.values() for name in names for one in subscales(name) for item in one.items]
    return answers.filter(~pl.col("question").is_in(items))


def scores(export: Export, episodes: pl.DataFrame, used: Mapping[str, Sequence[str]]) -> pl.DataFrame:
    """Return the mean of each subscale's items, reversed where the scale says so, for each page that a person of the
    analysed `episodes` answered. A score needs half of the items or more."""
    people = episodes.select("participant", "condition").unique(maintain_order=True)
    answers = export.all_answers.join(people, on="participant", how="inner")
    counting = episodes["episode"].to_list()
    found = [
        _scored(answers.filter(_is_page_of(key, counting)), key, one)
        for key, names in used.items()
        for name in names
        for one in subscales(name)
    ]
    return pl.concat([pl.DataFrame(schema=SCORES), *found])


def _is_page_of(questionnaire: str, episodes: Sequence[str]) -> pl.Expr:
    """Return whether an answer is of this questionnaire, about the study or one of the episodes. A page after a round
    whose partner withdrew no longer names an episode, as the round was deleted; it is not about the study."""
    step = pl.col("step").cast(pl.String)
    is_after_round = step.str.contains(rf"^{re.escape(questionnaire)}-\d+$")
    return (step == questionnaire) | (is_after_round & pl.col("episode").is_in(episodes).fill_null(value=False))


def _scored(answers: pl.DataFrame, questionnaire: str, subscale: Subscale) -> pl.DataFrame:
    pages = ("participant", "condition", "step", "episode")
    by_page = _directed(answers, subscale).group_by(*pages, maintain_order=True)
    table = by_page.agg(score=pl.col("value").mean(), answered=pl.len().cast(pl.Int64))
    names = {"questionnaire": questionnaire, "scale": subscale.scale, "subscale": subscale.name}
    constants = names | {"items": len(subscale.items)}
    table = table.with_columns(pl.lit(value).alias(name) for name, value in constants.items())
    enough = table.filter(pl.col("answered") * 2 >= len(subscale.items))
    return enough.select(pl.col(name).cast(kind) for name, kind in SCORES.items())


def _directed(answers: pl.DataFrame, subscale: Subscale) -> pl.DataFrame:
    """Return the answers to the items, so that more of them is more of what the subscale measures."""
    turned = [item for item, is_reversed in subscale.items.items() if is_reversed]
    value = pl.when(pl.col("question").is_in(turned)).then(subscale.total - pl.col("value")).otherwise(pl.col("value"))
    return answers.filter(pl.col("question").is_in(list(subscale.items))).with_columns(value=value)


def rows(
    export: Export, table: pl.DataFrame, used: Mapping[str, Sequence[str]], conditions: Sequence[str]
) -> list[Result]:
    """Return for each subscale the mean over people in each condition, its reliability, and t-tests between conditions
    over people, Benjamini-Hochberg over all of them. `table`: the scores."""
    found: list[Result] = []
    tests: list[Result] = []
    for key, names in used.items():
        for one in (one for name in names for one in subscales(name)):
            chosen = table.filter(questionnaire=key, scale=one.scale, subscale=one.name)
            if chosen.is_empty():
                continue
            base = Result(SECTION, "mean", question=f"{key}/{one.scale}/{one.name}", unit="people")
            means = _of_people(chosen)
            found += [mean_row(replace(base, condition=name), means[name]) for name in conditions if name in means]
            found += list(_reliability(replace(base, condition="all"), _complete(export, chosen, one)))
            for first, second in pairs([name for name in conditions if name in means]):
                row = replace(base, test="t_test_people", contrast=f"{first} - {second}")
                tests.append(t_test(row, means[first], means[second]))
    return [*found, *adjust(tests)]


def _of_people(chosen: pl.DataFrame) -> dict[str, Values]:
    means = chosen.group_by("participant", "condition", maintain_order=True).agg(pl.col("score").mean())
    parts = means.partition_by("condition", as_dict=True, maintain_order=True)
    return {str(name): part["score"].to_numpy() for (name,), part in parts.items()}


def _complete(export: Export, chosen: pl.DataFrame, subscale: Subscale) -> Values:
    """Return one row per person with the mean answer to each item, of the people who answered every item: (people,
    items)."""
    answers = export.all_answers.with_columns(pl.col("step").cast(pl.String))
    answers = answers.join(chosen.select("participant", "step"), on=["participant", "step"], how="semi")
    means = _directed(answers, subscale).group_by("participant", "question").agg(pl.col("value").mean())
    wide = means.pivot("question", index="participant", values="value").drop("participant").drop_nulls()
    return wide.to_numpy().astype(np.float64)


def _reliability(base: Result, answers: Values) -> Iterator[Result]:
    """Return the row with Cronbach's alpha; for two items with the Spearman-Brown coefficient, as Eisinga et al. (2013)
    advise."""
    people, items = answers.shape
    if items < 2:
        return
    base = replace(base, test="spearman_brown" if items == 2 else "alpha", n=people)
    value = math.nan if people < MIN_PEOPLE else reliability(answers)
    note = "over the mean of every person" if math.isfinite(value) else "needs three people whose answers differ"
    yield replace(base, estimate=value, note=note)


def reliability(answers: Values) -> float:
    """Return Cronbach's alpha of (people, items); of two items the Spearman-Brown coefficient. nan: not computable."""
    items: int = answers.shape[1]
    if items == 2:
        if (answers.std(axis=0) == 0).any():
            return math.nan
        r = float(np.corrcoef(answers[:, 0], answers[:, 1])[0, 1])
        return 2 * r / (1 + r) if r > -1 else math.nan
    total = float(answers.sum(axis=1).var(ddof=1))
    if total == 0:
        return math.nan
    return items / (items - 1) * (1 - float(answers.var(axis=0, ddof=1).sum()) / total)
