"""Simulated participants are counted apart from people"""

import sqlalchemy as sa
from alembic import op


revision = '0016'
down_revision = '0015'
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column('studies', sa.Column('simulated_started', sa.Integer(), server_default='0', nullable=False))
    op.add_column('participants', sa.Column('allocation_number', sa.Integer(), server_default='0', nullable=False))
    op.execute('UPDATE participants SET allocation_number = number')  # they keep the order of their episodes
