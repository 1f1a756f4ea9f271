"""Whether a timestep's marks were asked for and in view, and the key that asks for them"""

import sqlalchemy as sa
from alembic import op


revision = '0011'
down_revision = '0010'
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column('ticks', sa.Column('asked', sa.Boolean(), nullable=True))
    op.add_column('ticks', sa.Column('misleading', sa.Boolean(), nullable=True))
    op.add_column('ticks', sa.Column('in_sight', sa.Boolean(), nullable=True))
    op.add_column('inputs', sa.Column('marks', sa.Boolean(), nullable=True))
