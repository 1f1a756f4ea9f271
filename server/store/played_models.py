"""The agents and predictors of the rounds that people have played, by the SHA-256 of their weights."""

from dataclasses import dataclass

from sqlalchemy import Connection, false, func, select, union_all

from server.store.tables import episodes, participants, studies

_e, _p, _s = episodes.c, participants.c, studies.c
_MODELS = ((_e.agent_0, _e.agent_0_sha256), (_e.agent_1, _e.agent_1_sha256), (_e.predictor, _e.predictor_sha256))


@dataclass(frozen=True)
class PlayedModel:
    """`code_version`: the latest of the software on which it was played."""

    layout: str
    model: str
    sha256: str
    code_version: str
    rounds: int


def played_models(connection: Connection, study: str, sha256: str) -> list[PlayedModel]:
    """Return the models of the rounds of a version of a study, without those of simulated participants. `sha256`
    identifies the version."""
    person = _p.id == func.coalesce(_e.participant_0, _e.participant_1)
    of_people = episodes.join(studies, _s.id == _e.study_id).join(participants, person)
    rounds = union_all(
        *(
            select(_e.layout, model.label("model"), found.label("sha256"), _e.code_version)
            .select_from(of_people)
            .where(_s.key == study, _s.sha256 == sha256, _p.simulated == false(), model.is_not(None))
            .where(found.is_not(None))
            for model, found in _MODELS
        )
    ).subquery()
    by = (rounds.c.layout, rounds.c.model, rounds.c.sha256)
    latest, many = func.max(rounds.c.code_version).label("code_version"), func.count().label("rounds")
    query = select(*by, latest, many).group_by(*by).order_by(*by)
    return [PlayedModel(**row._mapping) for row in connection.execute(query)]
