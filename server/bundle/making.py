"""Make a bundle, the archive that is registered before a study begins, and open one to serve it."""

import json
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path

from server.bundle import texts
from server.bundle.archive import BundleRefused, packed, unpacked
from server.bundle.state import BundleState, differences, outside_models, state_of
from server.participation.episode_specs import layout_of
from server.settings import own_models_here
from server.study.loader import StudyError, StudyFile, parse_study

FORMAT = 1
STUDY = "study.yaml"


@dataclass(frozen=True)
class Bundle:
    """A bundle that fits this machine."""

    file: StudyFile
    code_version: str


def make(file: StudyFile, people: int | None = None, plan: str = "") -> bytes:
    """Return the archive; the same for the same study on the same code. `plan`: the researchers' own text.

    Raises StateError for models that are not here, LayoutError, StudyError.
    """
    study, state = file.study, state_of(file)
    number = people or texts.planned_people(study)
    content = {
        STUDY: file.text,
        "allocation.csv": texts.allocation(study, number),
        "questions.md": texts.questions(study),
        "analysis.json": json.dumps(texts.planned_analysis(study), indent=2, ensure_ascii=False) + "\n",
        "readme.md": texts.readme(study, state, number),
    }
    kitchens = (*study.layouts, study.tutorial.layout)
    content |= {f"layouts/{kitchen.name}.layout": layout_of(kitchen).text + "\n" for kitchen in kitchens}
    if plan:
        content["plan.md"] = plan
    manifest = {"format": FORMAT, "study": study.name, "study_sha256": file.sha256, "state": state.to_manifest()}
    return packed(content, manifest)


def open_bundle(path: Path, allowed: Collection[str] = (), own_models: Path | None = None) -> Bundle:
    """Return the study of a bundle, if everything here matches it. `allowed`: models whose code may run, or whose
    address may be called, although the bundle does not contain them; `own_models`: the folder of trained models, else
    that of the settings. Raises BundleRefused, OSError."""
    content, manifest = unpacked(path)
    try:
        wanted = BundleState.of(manifest["state"])
        is_known = manifest["format"] == FORMAT
        file = parse_study(content[STUDY], f"{path}: {STUDY}")
        file = replace(file, folder=path.absolute().parent, own_models=own_models or own_models_here())
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        reason = str(error) if isinstance(error, StudyError) else f"{path} is not a bundle."
        raise BundleRefused(f"{reason} Make one with `kitchenmind bundle STUDY`.") from None
    if not is_known:
        raise BundleRefused(f"{path} was made by another version. Use the kitchenmind that made it.")
    outside = [model for model in outside_models(file) if model not in allowed]
    if outside:
        options = " ".join(f"--allow-model {model}" for model in outside)
        raise BundleRefused(
            f"{path} names models that are code or an address outside of kitchenmind: {', '.join(outside)}. Look at "
            f"what they do. If you trust them, allow them: {options}"
        )
    try:
        found = differences(wanted, state_of(file))
    except (ValueError, FileNotFoundError) as error:
        found = [str(error)]
    if found:
        lines = "\n".join(f"- {line}" for line in found)
        remedy = f"Go back to kitchenmind {wanted.code_version}, or make and register a new bundle."
        raise BundleRefused(f"{path} is not what would run here:\n{lines}\n{remedy}")
    return Bundle(file, wanted.code_version)
