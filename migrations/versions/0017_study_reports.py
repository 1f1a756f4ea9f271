"""Reports that were made in the dashboard"""

import sqlalchemy as sa
from alembic import op


revision = '0017'
down_revision = '0016'
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table('study_reports',
    sa.Column('id', sa.Integer(), autoincrement=True, nullable=False),
    sa.Column('study', sa.String(length=128), nullable=False),
    sa.Column('started_by', sa.String(length=128), nullable=False),
    sa.Column('started_at', sa.DateTime(timezone=True), nullable=False),
    sa.Column('stage', sa.String(length=128), nullable=False),
    sa.Column('seen_at', sa.DateTime(timezone=True), nullable=False),
    sa.Column('failure', sa.Text(), nullable=True),
    sa.Column('made_at', sa.DateTime(timezone=True), nullable=True),
    sa.Column('participants', sa.Integer(), nullable=True),
    sa.Column('simulated', sa.Boolean(), nullable=True),
    sa.Column('archive', sa.LargeBinary(), nullable=True),
    sa.PrimaryKeyConstraint('id', name=op.f('pk_study_reports'))
    )
    op.create_index(op.f('ix_study_reports_study'), 'study_reports', ['study'])
