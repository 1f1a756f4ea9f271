"""Kitchens that researchers draw in the dashboard, with their history"""

import sqlalchemy as sa
from alembic import op


revision = '0012'
down_revision = '0011'
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table('kitchens',
    sa.Column('id', sa.Integer(), autoincrement=True, nullable=False),
    sa.Column('name', sa.String(length=128), nullable=False),
    sa.Column('version', sa.Integer(), nullable=False),
    sa.Column('grid', sa.Text(), nullable=True),
    sa.Column('saved_by', sa.String(length=128), nullable=False),
    sa.Column('saved_at', sa.DateTime(timezone=True), nullable=False),
    sa.PrimaryKeyConstraint('id', name=op.f('pk_kitchens')),
    sa.UniqueConstraint('name', 'version', name=op.f('uq_kitchens_name_version'))
    )
