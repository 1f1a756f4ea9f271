"""Analyse a study in one call: from an export to result rows and everything else that a report needs."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import polars as pl

from analysis import (
    accuracy,
    assumptions,
    compare,
    data_quality,
    exclusions,
    factorial,
    factorial_within,
    intentions,
    limited_sight,
    measures,
    mixed_model,
    model_cards,
    on_demand,
    power,
    primary,
    questionnaires,
    reliance,
    scales,
)
from analysis import ranks as ranking
from analysis.declared import Declaration, DeclaredTest, declaration_of
from analysis.groups import ALL, cells, main_contrast
from analysis.results import Result
from analysis.robustness import RobustnessInputs, robustness_rows
from analysis.simulated_participants import Subjects
from analysis.tables import Export, ExportError

MEASURE = "reward"
POWER_EFFECTS = (5.0, 8.0, 12.0)
QUESTIONNAIRE_LAYOUTS = 4  # the published choice: where prediction helped


@dataclass(frozen=True)
class Options:
    """The options of the analysis. Empty: as published."""

    questionnaire_layouts: tuple[str, ...] = ()
    effects: tuple[float, ...] = POWER_EFFECTS  # true differences for the power curve, points
    power_studies: int = power.STUDIES  # simulated for every point of it
    draws: int = ranking.DRAWS  # permutations, and bootstrap draws
    seed: int = ranking.SEED  # all that is drawn at random comes from it
    weights: Path | None = None  # folder of checkpoints, whose cards have the offline accuracy


@dataclass(frozen=True)
class Analysis:
    """All results. `episodes` are those analysed, with their measures."""

    export: Export
    conditions: tuple[str, ...]
    layouts: tuple[str, ...]
    agents: tuple[str, ...]
    contrast: tuple[str, str] | None  # the main comparison: with prediction against without
    questionnaire_layouts: tuple[str, ...]
    episodes: pl.DataFrame
    quality: pl.DataFrame
    model: mixed_model.MixedModel
    powers: tuple[power.Power, ...]
    rows: tuple[Result, ...]
    declaration: Declaration = field(default_factory=Declaration)
    scores: pl.DataFrame = field(default_factory=pl.DataFrame)  # of published scales, one row a page and subscale

    @property
    def within(self) -> tuple[str, ...]:
        """The factors whose levels people meet in blocks of rounds; the conditions are then orders of the blocks."""
        return factorial_within.within_of(self.export)

    @property
    def subjects(self) -> Subjects:
        """What texts call those who took part."""
        return self.export.subjects


def _primary_rows(declared: DeclaredTest | None, episodes: pl.DataFrame, export: Export) -> list[Result]:
    return [] if declared is None else [primary.primary_row(declared, episodes, export)]


def _contrast_of(export: Export, conditions: Sequence[str]) -> tuple[str, str] | None:
    """Return the main contrast; None if factors vary within people: conditions are then orders of blocks, which are not
    the main question."""
    return None if factorial_within.within_of(export) else main_contrast(conditions)


def analyse(export: Export, options: Options) -> Analysis:
    """Compute everything. If data are missing, a row says why, or there is no row. Raises ExportError for an unknown
    layout."""
    every, layouts, agents = measures.episode_measures(export), export.layouts, export.agents
    episodes = measures.analysed(every, export.participants)
    conditions = tuple(name for name in export.conditions if name in set(episodes["condition"]))
    chosen = _questionnaire_layouts(options, layouts)
    used = scales.used_scales(export)
    answers = questionnaires.answers_on(scales.without_items(export.answers, used), episodes, chosen)
    scores = scales.scores(export, episodes, used)
    model = mixed_model.fit(episodes, MEASURE, conditions)
    design = AnalysisDesign(conditions, layouts, agents, _contrast_of(export, conditions))
    declaration = declaration_of(export)
    quality = data_quality.proposals(every, export.answers)
    compared = (conditions, layouts, agents, design.contrast, declaration, options.seed)
    rows = [
        *_primary_rows(declaration.primary, episodes, export),
        *exclusions.flow(export, every, episodes),
        *reward_rows(episodes, design, options),
        *model.rows,
        *assumptions.check(episodes, MEASURE, conditions, cells(layouts, agents)),
        *questionnaires.rows(answers, conditions, agents),
        *scales.rows(export, scores, used, conditions),
        *accuracy.offline(model_cards.known_offline(export, options.weights), layouts, agents),
        *accuracy.live(episodes, layouts, agents),
        *design_rows(export, episodes, answers, conditions),
        *robustness_rows(RobustnessInputs(export, every, episodes, quality, answers, *compared)),
    ]
    powers = tuple(_powers(model, episodes, design, options))
    return Analysis(
        export,
        *(conditions, layouts, agents, design.contrast),
        tuple(chosen),
        episodes,
        quality,
        model,
        powers,
        (*rows, *_power_rows(powers)),
        declaration,
        scores,
    )


def design_rows(
    export: Export, episodes: pl.DataFrame, answers: pl.DataFrame, conditions: Sequence[str]
) -> list[Result]:
    """Return the effects of factors, what was seen of the marks and the kitchen, and how people relied on the marks,
    where a study varies that."""
    return [
        *(factorial_within.repeated_rows if factorial_within.within_of(export) else factorial.factorial_rows)(
            export, episodes, answers
        ),
        *on_demand.rows(export.ticks, episodes, conditions),
        *limited_sight.rows(export.ticks, episodes, conditions),
        *intentions.rows(export.ticks, episodes, conditions),
        *reliance.rows(export.reliance, episodes, conditions),
    ]


def _questionnaire_layouts(options: Options, layouts: Sequence[str]) -> Sequence[str]:
    chosen = options.questionnaire_layouts or layouts[:QUESTIONNAIRE_LAYOUTS]
    if unknown := [name for name in chosen if name not in layouts]:
        raise ExportError(f"The export has no layout {unknown[0]}. It has: {', '.join(layouts)}.")
    return chosen


@dataclass(frozen=True)
class AnalysisDesign:
    """What is compared, and where."""

    conditions: tuple[str, ...]
    layouts: tuple[str, ...]
    agents: tuple[str, ...]
    contrast: tuple[str, str] | None


def reward_rows(episodes: pl.DataFrame, design: AnalysisDesign, options: Options) -> list[Result]:
    """Return means and tests of reward."""
    conditions, layouts, agents = design.conditions, design.layouts, design.agents
    both = [(layout, ALL) for layout in layouts] if len(agents) > 1 else []
    with_total = cells([*layouts, ALL] if len(layouts) > 1 else layouts, agents)
    return [
        *compare.means(episodes, MEASURE, conditions, with_total, "reward"),
        *compare.anova(episodes, MEASURE, conditions, [*cells(layouts, agents), *both]),
        *reward_tests(episodes, design, options.draws, options.seed),
    ]


def reward_tests(episodes: pl.DataFrame, design: AnalysisDesign, draws: int, seed: int) -> list[Result]:
    """Return the tests of reward that headlines and sentences speak of, with the published ones next to them."""
    rows = [
        *ranking.kruskal_wallis(episodes, MEASURE, design.conditions, design.agents, draws, seed),
        *compare.pairwise(episodes, MEASURE, design.conditions, cells(design.layouts, design.agents)),
    ]
    columns = [name for name, levels in (("layout", design.layouts), ("agent", design.agents)) if len(levels) > 1]
    if design.contrast is not None and columns:
        rows += ranking.dependence(episodes, MEASURE, design.contrast, columns, draws, seed)
    return rows


def smallest_condition(episodes: pl.DataFrame, conditions: Sequence[str]) -> int:
    """Return the number of participants in the smallest condition."""
    people = episodes.unique("participant")["condition"]
    return min((int((people == name).sum()) for name in conditions), default=0)


def _powers(
    model: mixed_model.MixedModel, episodes: pl.DataFrame, design: AnalysisDesign, options: Options
) -> list[power.Power]:
    """Return the power of studies of other sizes in which reward varies as it did in this one; none with blocks, where
    it would be that of a comparison of their orders (`kitchenmind power` has that of the effects)."""
    size = smallest_condition(episodes, design.conditions)
    if design.contrast is None or model.variance is None or model.variance.residual_sd == 0 or size < 2:
        return []
    each = round(episodes.height / episodes["participant"].n_unique())
    planned = power.PowerDesign(model.variance.person_sd, model.variance.residual_sd, each)
    sizes = power.sizes_for(planned, options.effects, size)
    return power.curve(planned, options.effects, sizes, options.power_studies, options.seed)


def _power_rows(powers: Sequence[power.Power]) -> list[Result]:
    kinds = ("people", "comparison", "some")
    return [
        Result(
            "power",
            kind,
            estimate=float(getattr(point, kind)),
            n=point.participants,
            unit="people in each condition",
            note=f"true difference {point.effect:g} points, {point.studies} simulated studies",
        )
        for point in powers
        for kind in kinds
    ]
