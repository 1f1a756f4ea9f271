"""Record which process may store ticks of an episode"""

import sqlalchemy as sa
from alembic import op


revision = '0004'
down_revision = '0003'
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column('episodes', sa.Column('fence', sa.Integer(), server_default='0', nullable=False))
