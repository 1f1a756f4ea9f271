"""Whether the answer to an attention check was the one asked for"""

from typing import Any

import sqlalchemy as sa
from alembic import op


revision = '0010'
down_revision = '0009'
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column('answers', sa.Column('attention', sa.Boolean(), nullable=True))
    _mark_failed(op.get_bind())


def _mark_failed(connection: Any) -> None:
    """Mark failed checks, which were stored as events only. Passed checks were not stored at all."""
    events = sa.table('events', sa.column('participant_id'), sa.column('kind'), sa.column('detail', sa.JSON()))
    answers = sa.table(
        'answers', *(sa.column(name) for name in ('participant_id', 'step_key', 'question_key')), sa.column('attention', sa.Boolean())
    )
    noted = sa.select(events.c.participant_id, events.c.detail).where(events.c.kind == 'attention_failed')
    for participant, detail in connection.execute(noted).all():
        here = (answers.c.participant_id == participant, answers.c.step_key == detail['step'])
        failed = answers.c.question_key.in_(detail['questions'])
        connection.execute(sa.update(answers).where(*here, failed).values(attention=False))
