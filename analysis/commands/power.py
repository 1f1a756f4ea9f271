"""`kitchenmind power`: how many participants a study needs, by simulation on its own design."""

import argparse
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from analysis.declared import DeclaredTest
    from analysis.power import PowerDesign

INSTEAD = "Give both --person-sd and --residual-sd with a study file."
FOR_TWO = (
    "These are participants who are analysed. A round of two people counts for the one who is not watched, so recruit "
    "two people for each of them."
)


@dataclass(frozen=True)
class StudyPlan:
    """Episodes of a participant, planned participants, and the variance of reward if data are given."""

    episodes: int
    participants: int
    person_sd: float | None = None
    residual_sd: float | None = None
    declared: "DeclaredTest | None" = None  # the primary test of the study file
    primary_episodes: int = 0  # of a participant that the primary test uses
    factors: dict[str, int] = field(default_factory=dict)  # how many levels each has
    within: tuple[str, ...] = ()  # factors of which each participant meets all levels, in blocks
    left_out: tuple[str, ...] = ()  # combinations of levels that the study does not have
    answer_sds: tuple[float, float] | None = None  # between and within people, of the primary test's question
    simulated: bool = False  # the variances come from simulated participants
    for_two: bool = False  # rounds are played by two people, and count for one of them


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument("source", type=Path, metavar="STUDY_OR_EXPORT", help="a study file, or the export of a pilot")
    parser.add_argument(
        "--effect",
        type=float,
        nargs="+",
        default=[],
        metavar="POINTS",
        help="true differences of mean reward; tests are two-sided, so -5 needs as many participants as 5",
    )
    parser.add_argument(
        "--simulated-effect",
        action="store_true",
        help="also the difference that predictions made for simulated participants: not evidence about people",
    )
    parser.add_argument(
        "--answer-effect",
        type=float,
        nargs="+",
        default=[],
        metavar="POINTS",
        help="true differences on the answer scale, if the primary test is about a question (needs a pilot)",
    )
    _add_data_arguments(parser)
    parser.add_argument("--alpha", type=float, default=0.05, help="significance level (default: 0.05)")
    parser.add_argument(
        "--studies", type=int, default=2000, help="number of simulated studies for each point (default: 2000)"
    )
    parser.add_argument("--seed", type=int, default=1, help="random seed (default: 1)")
    parser.add_argument("--out", type=Path, default=Path("power"), help="folder to write (default: power)")


def _add_data_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options about the number of participants and the variance of their reward."""
    parser.add_argument(
        "--participants", type=int, help="participants in each condition (default: as in the export, else 29)"
    )
    parser.add_argument("--pilot", type=Path, help="export that shows how reward varies, together with a study file")
    parser.add_argument("--study", help="which study, if the export or pilot holds several")
    parser.add_argument("--study-version", type=int, metavar="N", help="which version of its study file (default: all)")
    parser.add_argument(
        "--person-sd", type=float, help="standard deviation between people in points, instead of a pilot"
    )
    parser.add_argument(
        "--residual-sd", type=float, help="standard deviation within people in points, instead of a pilot"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print a sentence for every effect; write power.csv, power.svg and power.png; 2 with a reason for bad input."""
    from analysis import simulated_effect

    try:
        if arguments.simulated_effect:
            arguments.effect = [*arguments.effect, simulated_effect.points()]
        if not arguments.effect:
            raise ValueError("give --effect with the true differences to be found, or --simulated-effect.")
        design, plan, participants = _design(arguments)
    except ValueError as error:
        print(f"kitchenmind power: {error}", file=sys.stderr)
        return 2
    for line in () if plan.within else _curve(design, plan, participants, arguments):
        print(line)
    if arguments.simulated_effect:
        print(simulated_effect.source())
    if plan.simulated:
        print(simulated_effect.VARIANCES)
    if plan.for_two:
        print(FOR_TWO)
    for line in (
        *_factor_lines(design, plan, participants, arguments),
        *_primary_lines(design, plan, participants, arguments),
    ):
        print(line)
    curve = f"The curve: {arguments.out / 'power.svg'}; its numbers: {arguments.out / 'power.csv'}"
    print(f"No curve: {', '.join(plan.within)} varies within participants." if plan.within else curve)
    return 0


def _curve(design: "PowerDesign", plan: StudyPlan, participants: int, arguments: argparse.Namespace) -> Iterator[str]:
    """Write the curve for two conditions, labelled where any of its numbers is simulated; a sentence for every
    effect."""
    from analysis import figure_style, figures, power

    sizes = power.sizes_for(design, arguments.effect, participants)
    points = power.curve(design, arguments.effect, sizes, arguments.studies, arguments.seed)
    arguments.out.mkdir(parents=True, exist_ok=True)
    simulated = plan.simulated or arguments.simulated_effect
    figure_style.save(figures.power(points, participants), arguments.out, "power", simulated)
    power.write_points(points, arguments.out / "power.csv", simulated)
    for effect in dict.fromkeys(arguments.effect):
        yield power.sentence(design, points, effect, participants)


def _primary_lines(
    design: "PowerDesign", plan: StudyPlan, participants: int, arguments: argparse.Namespace
) -> Iterator[str]:
    """Yield a sentence for every effect on the declared primary test."""
    from analysis import primary_power
    from analysis.declared import REWARD

    declared = plan.declared
    if declared is None:
        return
    effects, spread = arguments.effect, (design.person_sd, design.residual_sd)
    if declared.measure != REWARD:
        if not arguments.answer_effect or plan.answer_sds is None:
            yield (
                f"The primary test of the study file is about {declared.measure}. For its power, give --answer-effect "
                "and a pilot with answers to it."
            )
            return
        effects, spread = arguments.answer_effect, plan.answer_sds
    if unknown := [name for name in declared.effect if name not in plan.factors]:
        yield f"Primary test: no power, as the data have no factor {unknown[0]}."
        return
    of_primary = primary_power.PrimaryDesign(declared, *spread, plan.primary_episodes, plan.factors, plan.within)
    for effect in dict.fromkeys(effects):
        yield primary_power.sentence(of_primary, effect, participants, arguments.studies, arguments.seed)


def _factor_lines(
    design: "PowerDesign", plan: StudyPlan, participants: int, arguments: argparse.Namespace
) -> Iterator[str]:
    """Yield a sentence for each effect of the factors and each size."""
    from analysis import factorial_power

    if plan.left_out:
        yield f"Factorial: no power of its effects, as the study leaves out {', '.join(plan.left_out)}."
    elif plan.factors:
        for effect in dict.fromkeys(arguments.effect):
            yield from factorial_power.sentences(design, plan.factors, plan.within, effect, participants)


def _design(arguments: argparse.Namespace) -> "tuple[PowerDesign, StudyPlan, int]":
    """Return the design to simulate, the plan and the number of participants. Raises ValueError with a remedy."""
    from analysis.power import PowerDesign

    if arguments.source.is_dir():
        plan = _from_export(arguments.source, arguments)
    else:
        plan = _from_study(arguments.source)
        if arguments.pilot is not None:
            pilot = _from_export(arguments.pilot, arguments, plan.declared)
            names = ("person_sd", "residual_sd", "answer_sds", "simulated")
            plan = replace(plan, **{name: getattr(pilot, name) for name in names})
    person_sd = plan.person_sd if arguments.person_sd is None else arguments.person_sd
    residual_sd = plan.residual_sd if arguments.residual_sd is None else arguments.residual_sd
    if person_sd is None or residual_sd is None:
        raise ValueError(
            "the variance of reward is unknown. Give --pilot with the export of a pilot or of bots, or both "
            "--person-sd and --residual-sd."
        )
    participants = plan.participants if arguments.participants is None else arguments.participants
    if arguments.participants is None and participants < 2:
        raise ValueError("the smallest condition of the data has fewer than two participants. Give --participants.")
    _check(arguments, person_sd, residual_sd, participants)
    return PowerDesign(person_sd, residual_sd, plan.episodes, arguments.alpha), plan, participants


def _check(arguments: argparse.Namespace, person_sd: float, residual_sd: float, participants: int) -> None:
    """Raise ValueError for an option that is out of range."""
    from analysis.power import MOST

    bounds = {
        "--effect": (all(math.isfinite(effect) for effect in arguments.effect), "Use numbers."),
        "--answer-effect": (all(math.isfinite(effect) for effect in arguments.answer_effect), "Use numbers."),
        "--participants": (2 <= participants <= MOST, f"Use 2 to {MOST:,}."),
        "--studies": (arguments.studies >= 1, "Use at least 1."),
        "--alpha": (0 < arguments.alpha < 1, "Use a number between 0 and 1."),
        "--person-sd": (0 <= person_sd < math.inf, "Use 0 or more."),
        "--residual-sd": (0 < residual_sd < math.inf, "Use a number above 0."),
        "--seed": (arguments.seed >= 0, "Use 0 or more."),
    }
    for name, (holds, remedy) in bounds.items():
        if not holds:
            raise ValueError(f"{name} is out of range. {remedy}")


def _from_export(folder: Path, arguments: argparse.Namespace, declared: "DeclaredTest | None" = None) -> StudyPlan:
    """Return how reward varied in a pilot, and answers if the primary test (`declared`, else its own) is about them."""
    from analysis import measures, mixed_model, primary
    from analysis.declared import declaration_of
    from analysis.exclusions import versions_notice
    from analysis.factorial import levels_in
    from analysis.factorial_within import repeated_factors, within_of
    from analysis.study import MEASURE, smallest_condition
    from analysis.tables import read_export
    from analysis.within_effects import with_levels

    export = read_export(folder, arguments.study, arguments.study_version)
    if notice := versions_notice(export):
        print(f"kitchenmind power: {notice}", file=sys.stderr)
    episodes = measures.analysed(measures.episode_measures(export), export.participants)
    model = mixed_model.fit(episodes, MEASURE, export.conditions)
    variance = model.variance
    if variance is None:
        raise ValueError(f"{folder} does not show how reward varies: its mixed model {model.rows[0].note}. {INSTEAD}")
    within = within_of(export)
    factors = repeated_factors(export) if within else levels_in(export)
    plan = StudyPlan(
        round(episodes.height / episodes["participant"].n_unique()),
        smallest_condition(episodes, export.conditions),
        variance.person_sd,
        variance.residual_sd,
        declared or declaration_of(export).primary,
        factors={name: len(levels) for name, levels in factors.items()},
        within=within,
        left_out=tuple(export.about.get("left_out") or ()),
        simulated=export.is_simulated,
        for_two=episodes["watched_person"].is_not_null().any(),
    )
    if plan.declared is None:
        return plan
    table, measure = primary.values_of_episodes(plan.declared, episodes, export.answers)
    people = max(1, table["participant"].n_unique())
    plan = replace(plan, primary_episodes=max(1, round(table.height / people)))
    if measure == MEASURE:
        return plan
    spread = mixed_model.fit(with_levels(table, episodes), measure, export.conditions).variance
    return replace(plan, answer_sds=(spread.person_sd, spread.residual_sd)) if spread else plan


def _from_study(path: Path) -> StudyPlan:
    """Episodes of a participant as a study file plans them."""
    import yaml

    from analysis.declared import declared_test

    try:
        study = yaml.load(path.read_text(encoding="utf-8"), Loader=yaml.BaseLoader)  # noqa: S506 - texts only
        repeat = int(study.get("order", {}).get("repeat", 1))
        layouts, agents = len(study["layouts"]), len(study["agents"])
        partners = [str(agent.get("human")).lower() for agent in study["agents"] if isinstance(agent, dict)]
        for_two = bool({"true", "yes", "on"} & set(partners))
        factors = {name: len(levels) for name, levels in (study.get("factors") or {}).items()}
        cells = study.get("cells") or {}
        left_out, within = (tuple(map(str, cells.get(key) or ())) for key in ("without", "within"))
        repeat *= math.prod(factors[name] for name in within)  # each block has all rounds
    except OSError as error:
        raise ValueError(
            f"cannot read {path}: {error.strerror}. Give a study file or the folder of an export."
        ) from None
    except (yaml.YAMLError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise ValueError(f"{path} is not a study file: it needs `layouts` and `agents`.") from None
    try:
        declared = declared_test(study)
    except ValueError as error:
        raise ValueError(f"{path}: {error}. `kitchenmind study check {path}` names the line.") from None
    used = (len(declared.layouts) or layouts) * (len(declared.agents) or agents) * repeat if declared else 0
    return StudyPlan(
        layouts * agents * repeat, 29, None, None, declared, used, factors, within, left_out, for_two=for_two
    )
