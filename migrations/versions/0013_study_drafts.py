"""Drafts of studies with their history, and the studies that were opened from them"""

import sqlalchemy as sa
from alembic import op


revision = '0013'
down_revision = '0012'
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table('study_drafts',
    sa.Column('id', sa.Integer(), autoincrement=True, nullable=False),
    sa.Column('name', sa.String(length=128), nullable=False),
    sa.Column('revision', sa.Integer(), nullable=False),
    sa.Column('source', sa.Text(), nullable=False),
    sa.Column('created_by', sa.String(length=128), nullable=False),
    sa.Column('created_at', sa.DateTime(timezone=True), nullable=False),
    sa.Column('changed_by', sa.String(length=128), nullable=False),
    sa.Column('changed_at', sa.DateTime(timezone=True), nullable=False),
    sa.Column('deleted_at', sa.DateTime(timezone=True), nullable=True),
    sa.PrimaryKeyConstraint('id', name=op.f('pk_study_drafts'))
    )
    op.create_table('study_draft_versions',
    sa.Column('id', sa.Integer(), autoincrement=True, nullable=False),
    sa.Column('draft_id', sa.Integer(), nullable=False),
    sa.Column('revision', sa.Integer(), nullable=False),
    sa.Column('source', sa.Text(), nullable=False),
    sa.Column('author', sa.String(length=128), nullable=False),
    sa.Column('note', sa.String(length=128), nullable=False),
    sa.Column('began_at', sa.DateTime(timezone=True), nullable=False),
    sa.Column('saved_at', sa.DateTime(timezone=True), nullable=False),
    sa.ForeignKeyConstraint(['draft_id'], ['study_drafts.id'], name=op.f('fk_study_draft_versions_draft_id_study_drafts')),
    sa.PrimaryKeyConstraint('id', name=op.f('pk_study_draft_versions'))
    )
    op.create_index(op.f('ix_study_draft_versions_draft_id'), 'study_draft_versions', ['draft_id'])
    op.create_table('study_openings',
    sa.Column('id', sa.Integer(), autoincrement=True, nullable=False),
    sa.Column('study', sa.String(length=128), nullable=False),
    sa.Column('study_id', sa.Integer(), nullable=False),
    sa.Column('draft_id', sa.Integer(), nullable=False),
    sa.Column('draft_revision', sa.Integer(), nullable=False),
    sa.Column('opened_by', sa.String(length=128), nullable=False),
    sa.Column('opened_at', sa.DateTime(timezone=True), nullable=False),
    sa.Column('closed_by', sa.String(length=128), nullable=True),
    sa.Column('closed_at', sa.DateTime(timezone=True), nullable=True),
    sa.ForeignKeyConstraint(['draft_id'], ['study_drafts.id'], name=op.f('fk_study_openings_draft_id_study_drafts')),
    sa.ForeignKeyConstraint(['study_id'], ['studies.id'], name=op.f('fk_study_openings_study_id_studies')),
    sa.PrimaryKeyConstraint('id', name=op.f('pk_study_openings'))
    )
    op.create_index(op.f('ix_study_openings_study'), 'study_openings', ['study'])
