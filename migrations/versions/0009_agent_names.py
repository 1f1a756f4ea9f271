"""What the study calls the agent of an episode"""

import sqlalchemy as sa
from alembic import op


revision = '0009'
down_revision = '0008'
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column('episodes', sa.Column('agent_name', sa.String(length=128), nullable=True))
