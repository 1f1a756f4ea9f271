"""Episodes have the researcher who pauses them"""

import sqlalchemy as sa
from alembic import op


revision = '0020'
down_revision = '0019'
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column('episodes', sa.Column('paused_by', sa.String(128), nullable=True))
