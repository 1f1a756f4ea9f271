"""Researchers' accounts and decisions"""

import sqlalchemy as sa
from alembic import op


revision = '0002'
down_revision = '0001'
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table('admins',
    sa.Column('name', sa.String(length=128), nullable=False),
    sa.Column('password_hash', sa.Text(), nullable=False),
    sa.Column('role', sa.String(length=16), nullable=False),
    sa.Column('created_at', sa.DateTime(timezone=True), nullable=False),
    sa.PrimaryKeyConstraint('name', name=op.f('pk_admins'))
    )
    op.create_table('admin_sessions',
    sa.Column('token_hash', sa.String(length=64), nullable=False),
    sa.Column('admin', sa.String(length=128), nullable=False),
    sa.Column('blind', sa.Boolean(), nullable=False),
    sa.Column('created_at', sa.DateTime(timezone=True), nullable=False),
    sa.Column('seen_at', sa.DateTime(timezone=True), nullable=False),
    sa.ForeignKeyConstraint(['admin'], ['admins.name'], name=op.f('fk_admin_sessions_admin_admins')),
    sa.PrimaryKeyConstraint('token_hash', name=op.f('pk_admin_sessions'))
    )
    op.create_index(op.f('ix_admin_sessions_admin'), 'admin_sessions', ['admin'])
    op.create_table('exclusions',
    sa.Column('id', sa.Integer(), autoincrement=True, nullable=False),
    sa.Column('participant_id', sa.String(length=32), nullable=False),
    sa.Column('episode_id', sa.String(length=32), nullable=True),
    sa.Column('reason', sa.String(length=128), nullable=False),
    sa.Column('note', sa.Text(), nullable=False),
    sa.Column('excluded_by', sa.String(length=128), nullable=False),
    sa.Column('excluded_at', sa.DateTime(timezone=True), nullable=False),
    sa.Column('restored_by', sa.String(length=128), nullable=True),
    sa.Column('restored_at', sa.DateTime(timezone=True), nullable=True),
    sa.ForeignKeyConstraint(['participant_id'], ['participants.id'], name=op.f('fk_exclusions_participant_id_participants')),
    sa.ForeignKeyConstraint(['episode_id'], ['episodes.id'], name=op.f('fk_exclusions_episode_id_episodes')),
    sa.PrimaryKeyConstraint('id', name=op.f('pk_exclusions'))
    )
    op.create_index(op.f('ix_exclusions_participant_id'), 'exclusions', ['participant_id'])
    op.create_index(op.f('ix_exclusions_episode_id'), 'exclusions', ['episode_id'])
    op.create_table('study_pauses',
    sa.Column('id', sa.Integer(), autoincrement=True, nullable=False),
    sa.Column('study', sa.String(length=128), nullable=False),
    sa.Column('paused_by', sa.String(length=128), nullable=False),
    sa.Column('paused_at', sa.DateTime(timezone=True), nullable=False),
    sa.Column('resumed_by', sa.String(length=128), nullable=True),
    sa.Column('resumed_at', sa.DateTime(timezone=True), nullable=True),
    sa.PrimaryKeyConstraint('id', name=op.f('pk_study_pauses'))
    )
    op.create_index(op.f('ix_study_pauses_study'), 'study_pauses', ['study'])
