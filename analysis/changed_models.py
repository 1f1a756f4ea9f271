"""Find agents and predictors that had other weights in some rounds than in others of the same kitchen, such as after an
upgrade of the software in the middle of a study.
"""

import polars as pl

from analysis.formatting import layout_title, listed
from analysis.tables import Export

_MODELS = (("agent_0", "agent_0_sha256"), ("agent_1", "agent_1_sha256"), ("predictor", "predictor_sha256"))


def changed_models(episodes: pl.DataFrame) -> list[tuple[str, str, list[int]]]:
    """Return model, layout and the number of rounds with each of its weights, of the models that had more than one. An
    older export has no hashes, and then nothing is found."""
    tables = [
        episodes.select(model=pl.col(name).cast(pl.String), layout="layout", sha256=pl.col(sha256).cast(pl.String))
        for name, sha256 in _MODELS
        if {name, sha256} <= set(episodes.columns)
    ]
    if not tables:
        return []
    played = pl.concat(tables).filter(pl.col("sha256").fill_null("") != "")
    counts = played.group_by("layout", "model", "sha256", maintain_order=True).len()
    several = counts.group_by("layout", "model", maintain_order=True).agg("len").filter(pl.col("len").list.len() > 1)
    return [(model, layout, rounds) for layout, model, rounds in several.iter_rows()]


def models_notice(export: Export) -> str:
    """Say which models were not the same in all rounds; empty if all were."""
    if not (found := changed_models(export.episodes)):
        return ""
    parts = [
        f"{model} in {layout_title(layout)} ({listed([str(count) for count in rounds])} rounds)"
        for model, layout, rounds in found
    ]
    return (
        "The weights of an agent or a predictor changed during the study, so that participants played with different "
        f"ones of the same name: {listed(parts)}. The columns agent_0_sha256, agent_1_sha256 and predictor_sha256 of "
        "the episodes say who played with which; code_version says on which version of the software."
    )
