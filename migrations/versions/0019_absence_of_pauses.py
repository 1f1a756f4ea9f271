"""How much of a pause counted as absence of people"""

import sqlalchemy as sa
from alembic import op


revision = '0019'
down_revision = '0018'
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column('pauses', sa.Column('away_ms', sa.Double(), nullable=True))
