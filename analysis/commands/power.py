"""`kitchenmind power`: how many participants a study needs, by simulation on its own design."""

import argparse
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from analysis.power import PowerDesign


@dataclass(frozen=True)
class StudyPlan:
    """Episodes of a participant, participants planned, and the spread of reward where data say it."""

    episodes: int
    participants: int
    person_sd: float | None = None
    residual_sd: float | None = None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the verb takes."""
    parser.add_argument("source", type=Path, metavar="STUDY_OR_EXPORT", help="a study file, or the export of a pilot")
    parser.add_argument(
        "--effect",
        type=float,
        nargs="+",
        required=True,
        metavar="POINTS",
        help="true differences of mean reward; tests are two-sided, so -5 needs as many participants as 5",
    )
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
    parser.add_argument("--alpha", type=float, default=0.05, help="significance level (default: 0.05)")
    parser.add_argument(
        "--studies", type=int, default=2000, help="number of simulated studies for each point (default: 2000)"
    )
    parser.add_argument("--seed", type=int, default=1, help="random seed (default: 1)")
    parser.add_argument("--out", type=Path, default=Path("power"), help="folder to write (default: power)")


def run(arguments: argparse.Namespace) -> int:
    """Print a sentence for every effect; write power.csv, power.svg and power.png; 2 with a reason for bad input."""
    from analysis import figures, power

    try:
        design, participants = _design(arguments)
    except ValueError as error:
        print(f"kitchenmind power: {error}", file=sys.stderr)
        return 2
    sizes = power.sizes_for(design, arguments.effect, participants)
    points = power.curve(design, arguments.effect, sizes, arguments.studies, arguments.seed)
    arguments.out.mkdir(parents=True, exist_ok=True)
    figures.save(figures.power(points, participants), arguments.out, "power")
    power.write_points(points, arguments.out / "power.csv")
    for effect in dict.fromkeys(arguments.effect):
        print(power.sentence(design, points, effect, participants))
    print(f"The curve: {arguments.out / 'power.svg'}; its numbers: {arguments.out / 'power.csv'}")
    return 0


def _design(arguments: argparse.Namespace) -> "tuple[PowerDesign, int]":
    """The design to simulate and the participants to speak about. Raises ValueError with a remedy."""
    from analysis.power import PowerDesign

    if arguments.source.is_dir():
        plan = _from_export(arguments.source, arguments)
    else:
        plan = _from_study(arguments.source)
        if arguments.pilot is not None:
            pilot = _from_export(arguments.pilot, arguments)
            plan = StudyPlan(plan.episodes, plan.participants, pilot.person_sd, pilot.residual_sd)
    person_sd = plan.person_sd if arguments.person_sd is None else arguments.person_sd
    residual_sd = plan.residual_sd if arguments.residual_sd is None else arguments.residual_sd
    if person_sd is None or residual_sd is None:
        raise ValueError(
            "nothing says how much reward varies. Give --pilot with the export of a pilot or of bots, or both "
            "--person-sd and --residual-sd."
        )
    participants = plan.participants if arguments.participants is None else arguments.participants
    _check(arguments, person_sd, residual_sd, participants)
    return PowerDesign(person_sd, residual_sd, plan.episodes, arguments.alpha), participants


def _check(arguments: argparse.Namespace, person_sd: float, residual_sd: float, participants: int) -> None:
    """Raise ValueError for a number that nothing can be simulated with."""
    from analysis.power import MOST

    bounds = {
        "--effect": (all(math.isfinite(effect) for effect in arguments.effect), "Use numbers."),
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


def _from_export(folder: Path, arguments: argparse.Namespace) -> StudyPlan:
    """How reward varied in a pilot."""
    from analysis import measures, mixed_model
    from analysis.exclusions import versions_notice
    from analysis.study import MEASURE, smallest_condition
    from analysis.tables import read_export

    export = read_export(folder, arguments.study, arguments.study_version)
    if notice := versions_notice(export):
        print(f"kitchenmind power: {notice}", file=sys.stderr)
    episodes = measures.analysed(measures.episode_measures(export), export.participants)
    model = mixed_model.fit(episodes, MEASURE, export.conditions)
    variance = model.variance
    if variance is None:
        raise ValueError(f"{folder} does not tell how reward varies: its mixed model {model.rows[0].note}.")
    each = round(episodes.height / episodes["participant"].n_unique())
    return StudyPlan(each, smallest_condition(episodes, export.conditions), variance.person_sd, variance.residual_sd)


def _from_study(path: Path) -> StudyPlan:
    """Episodes of a participant as a study file plans them."""
    import yaml

    try:
        study = yaml.load(path.read_text(encoding="utf-8"), Loader=yaml.BaseLoader)  # noqa: S506 - texts only
        repeat = int(study.get("order", {}).get("repeat", 1))
        return StudyPlan(len(study["layouts"]) * len(study["agents"]) * repeat, participants=29)
    except OSError as error:
        raise ValueError(
            f"cannot read {path}: {error.strerror}. Give a study file or the folder of an export."
        ) from None
    except (yaml.YAMLError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise ValueError(f"{path} is no study file: it needs `layouts` and `agents`.") from None
