"""Every input that arrived in a game, and when each state was made"""

import sqlalchemy as sa
from alembic import op


revision = '0008'
down_revision = '0007'
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column('ticks', sa.Column('made_unix_ms', sa.Double(), nullable=True))
    op.create_table('inputs',
    sa.Column('episode_id', sa.String(length=32), nullable=False),
    sa.Column('seat', sa.SmallInteger(), autoincrement=False, nullable=False),
    sa.Column('number', sa.Integer(), autoincrement=False, nullable=False),
    sa.Column('tab', sa.String(length=128), nullable=False),
    sa.Column('seq', sa.BigInteger(), nullable=False),
    sa.Column('held', sa.SmallInteger(), nullable=True),
    sa.Column('tap', sa.SmallInteger(), nullable=True),
    sa.Column('client_ms', sa.Double(), nullable=False),
    sa.Column('received_unix_ms', sa.Double(), nullable=False),
    sa.Column('received_ms', sa.Double(), nullable=True),
    sa.Column('timestep', sa.Integer(), nullable=True),
    sa.Column('outcome', sa.String(length=16), nullable=False),
    sa.ForeignKeyConstraint(['episode_id'], ['episodes.id'], name=op.f('fk_inputs_episode_id_episodes')),
    sa.PrimaryKeyConstraint('episode_id', 'seat', 'number', name=op.f('pk_inputs')),
    sqlite_with_rowid=False
    )
