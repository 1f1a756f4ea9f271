"""The watched chef's predicted intentions, and the one that was shown"""

import sqlalchemy as sa
from alembic import op


revision = '0014'
down_revision = '0013'
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column('ticks', sa.Column('intentions', sa.LargeBinary(length=16), nullable=True))
    op.add_column('ticks', sa.Column('displayed_intention', sa.LargeBinary(length=4), nullable=True))
