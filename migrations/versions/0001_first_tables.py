"""First tables"""

import sqlalchemy as sa
from alembic import op


revision = '0001'
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    create_tables()
    keep_audit_as_written()


def create_tables() -> None:
    op.create_table('audit',
    sa.Column('id', sa.Integer(), autoincrement=False, nullable=False),
    sa.Column('at', sa.DateTime(timezone=True), nullable=False),
    sa.Column('actor', sa.String(length=128), nullable=False),
    sa.Column('action', sa.String(length=128), nullable=False),
    sa.Column('detail', sa.Text(), nullable=True),
    sa.Column('salt', sa.String(length=32), nullable=True),
    sa.Column('detail_hash', sa.String(length=64), nullable=False),
    sa.Column('hash', sa.String(length=64), nullable=False),
    sa.CheckConstraint('id > 0', name=op.f('ck_audit_counts_from_one')),
    sa.PrimaryKeyConstraint('id', name=op.f('pk_audit'))
    )
    op.create_table('heartbeat',
    sa.Column('id', sa.Integer(), autoincrement=False, nullable=False),
    sa.Column('at', sa.DateTime(timezone=True), nullable=False),
    sa.PrimaryKeyConstraint('id', name=op.f('pk_heartbeat'))
    )
    op.create_table('studies',
    sa.Column('id', sa.Integer(), autoincrement=True, nullable=False),
    sa.Column('key', sa.String(length=128), nullable=False),
    sa.Column('version', sa.Integer(), nullable=False),
    sa.Column('sha256', sa.String(length=64), nullable=False),
    sa.Column('source', sa.Text(), nullable=False),
    sa.Column('started', sa.Integer(), server_default='0', nullable=False),
    sa.Column('created_at', sa.DateTime(timezone=True), nullable=False),
    sa.Column('frozen_at', sa.DateTime(timezone=True), nullable=True),
    sa.PrimaryKeyConstraint('id', name=op.f('pk_studies')),
    sa.UniqueConstraint('key', 'sha256', name=op.f('uq_studies_key_sha256')),
    sa.UniqueConstraint('key', 'version', name=op.f('uq_studies_key_version'))
    )
    op.create_table('participants',
    sa.Column('id', sa.String(length=32), nullable=False),
    sa.Column('study_id', sa.Integer(), nullable=False),
    sa.Column('number', sa.Integer(), nullable=False),
    sa.Column('condition', sa.String(length=128), nullable=False),
    sa.Column('seed', sa.BigInteger(), nullable=False),
    sa.Column('position', sa.Integer(), server_default='0', nullable=False),
    sa.Column('status', sa.String(length=16), server_default='active', nullable=False),
    sa.Column('language', sa.String(length=16), server_default='en', nullable=False),
    sa.Column('simulated', sa.Boolean(), nullable=False),
    sa.Column('started_at', sa.DateTime(timezone=True), nullable=False),
    sa.Column('last_seen_at', sa.DateTime(timezone=True), nullable=False),
    sa.Column('completed_at', sa.DateTime(timezone=True), nullable=True),
    sa.Column('completion_code', sa.String(length=64), nullable=True),
    sa.Column('token_hash', sa.String(length=64), nullable=False),
    sa.ForeignKeyConstraint(['study_id'], ['studies.id'], name=op.f('fk_participants_study_id_studies')),
    sa.PrimaryKeyConstraint('id', name=op.f('pk_participants')),
    sa.UniqueConstraint('study_id', 'number', name=op.f('uq_participants_study_id_number')),
    sa.UniqueConstraint('token_hash', name=op.f('uq_participants_token_hash'))
    )
    with op.batch_alter_table('participants', schema=None) as batch_op:
        batch_op.create_index(batch_op.f('ix_participants_study_id_condition_status'), ['study_id', 'condition', 'status'], unique=False)

    op.create_table('withdrawals',
    sa.Column('id', sa.Integer(), autoincrement=True, nullable=False),
    sa.Column('study_id', sa.Integer(), nullable=False),
    sa.Column('condition', sa.String(length=128), nullable=False),
    sa.Column('position', sa.Integer(), nullable=False),
    sa.Column('withdrawn_at', sa.DateTime(timezone=True), nullable=False),
    sa.ForeignKeyConstraint(['study_id'], ['studies.id'], name=op.f('fk_withdrawals_study_id_studies')),
    sa.PrimaryKeyConstraint('id', name=op.f('pk_withdrawals'))
    )
    with op.batch_alter_table('withdrawals', schema=None) as batch_op:
        batch_op.create_index(batch_op.f('ix_withdrawals_study_id'), ['study_id'], unique=False)

    op.create_table('episodes',
    sa.Column('id', sa.String(length=32), nullable=False),
    sa.Column('study_id', sa.Integer(), nullable=True),
    sa.Column('step_key', sa.String(length=128), nullable=False),
    sa.Column('attempt', sa.Integer(), server_default='1', nullable=False),
    sa.Column('kind', sa.String(length=16), nullable=False),
    sa.Column('number', sa.Integer(), nullable=False),
    sa.Column('participant_0', sa.String(length=32), nullable=True),
    sa.Column('participant_1', sa.String(length=32), nullable=True),
    sa.Column('condition', sa.String(length=128), nullable=True),
    sa.Column('layout', sa.String(length=128), nullable=False),
    sa.Column('layout_sha256', sa.String(length=64), nullable=False),
    sa.Column('grid', sa.Text(), nullable=False),
    sa.Column('agent_0', sa.String(length=128), nullable=True),
    sa.Column('agent_1', sa.String(length=128), nullable=True),
    sa.Column('agent_0_sha256', sa.String(length=64), nullable=True),
    sa.Column('agent_1_sha256', sa.String(length=64), nullable=True),
    sa.Column('predictor', sa.String(length=128), nullable=True),
    sa.Column('predictor_sha256', sa.String(length=64), nullable=True),
    sa.Column('watched_seat', sa.SmallInteger(), nullable=False),
    sa.Column('shown', sa.String(length=16), nullable=False),
    sa.Column('seed', sa.BigInteger(), nullable=False),
    sa.Column('horizon', sa.Integer(), nullable=False),
    sa.Column('tick_ms', sa.Integer(), nullable=False),
    sa.Column('spec', sa.JSON(), nullable=False),
    sa.Column('status', sa.String(length=16), server_default='new', nullable=False),
    sa.Column('end_reason', sa.String(length=64), nullable=True),
    sa.Column('score', sa.Integer(), nullable=True),
    sa.Column('soups', sa.Integer(), nullable=True),
    sa.Column('progress', sa.Double(), nullable=True),
    sa.Column('passed', sa.Boolean(), nullable=True),
    sa.Column('final_hash', sa.String(length=16), nullable=True),
    sa.Column('code_version', sa.String(length=64), nullable=False),
    sa.Column('created_at', sa.DateTime(timezone=True), nullable=False),
    sa.Column('started_at', sa.DateTime(timezone=True), nullable=True),
    sa.Column('ended_at', sa.DateTime(timezone=True), nullable=True),
    sa.ForeignKeyConstraint(['participant_0'], ['participants.id'], name=op.f('fk_episodes_participant_0_participants')),
    sa.ForeignKeyConstraint(['participant_1'], ['participants.id'], name=op.f('fk_episodes_participant_1_participants')),
    sa.ForeignKeyConstraint(['study_id'], ['studies.id'], name=op.f('fk_episodes_study_id_studies')),
    sa.PrimaryKeyConstraint('id', name=op.f('pk_episodes')),
    sa.UniqueConstraint('participant_0', 'step_key', 'attempt', name=op.f('uq_episodes_participant_0_step_key_attempt')),
    sa.UniqueConstraint('participant_1', 'step_key', 'attempt', name=op.f('uq_episodes_participant_1_step_key_attempt'))
    )
    with op.batch_alter_table('episodes', schema=None) as batch_op:
        batch_op.create_index(batch_op.f('ix_episodes_participant_0'), ['participant_0'], unique=False)
        batch_op.create_index(batch_op.f('ix_episodes_participant_1'), ['participant_1'], unique=False)
        batch_op.create_index(batch_op.f('ix_episodes_study_id_status'), ['study_id', 'status'], unique=False)

    op.create_table('personal',
    sa.Column('participant_id', sa.String(length=32), nullable=False),
    sa.Column('key', sa.String(length=128), nullable=False),
    sa.Column('study_id', sa.Integer(), nullable=False),
    sa.Column('value', sa.Text(), nullable=False),
    sa.ForeignKeyConstraint(['participant_id'], ['participants.id'], name=op.f('fk_personal_participant_id_participants')),
    sa.ForeignKeyConstraint(['study_id'], ['studies.id'], name=op.f('fk_personal_study_id_studies')),
    sa.PrimaryKeyConstraint('participant_id', 'key', name=op.f('pk_personal'))
    )
    with op.batch_alter_table('personal', schema=None) as batch_op:
        batch_op.create_index('one_row_per_person_and_study', ['study_id', 'value'], unique=True, sqlite_where=sa.text('"key" = \'recruitment_id\''), postgresql_where=sa.text('"key" = \'recruitment_id\''))

    op.create_table('visits',
    sa.Column('id', sa.Integer(), autoincrement=True, nullable=False),
    sa.Column('participant_id', sa.String(length=32), nullable=False),
    sa.Column('step_key', sa.String(length=128), nullable=False),
    sa.Column('entered_at', sa.DateTime(timezone=True), nullable=False),
    sa.Column('left_at', sa.DateTime(timezone=True), nullable=True),
    sa.ForeignKeyConstraint(['participant_id'], ['participants.id'], name=op.f('fk_visits_participant_id_participants')),
    sa.PrimaryKeyConstraint('id', name=op.f('pk_visits'))
    )
    with op.batch_alter_table('visits', schema=None) as batch_op:
        batch_op.create_index(batch_op.f('ix_visits_participant_id'), ['participant_id'], unique=False)

    op.create_table('answers',
    sa.Column('id', sa.Integer(), autoincrement=True, nullable=False),
    sa.Column('participant_id', sa.String(length=32), nullable=False),
    sa.Column('episode_id', sa.String(length=32), nullable=True),
    sa.Column('step_key', sa.String(length=128), nullable=False),
    sa.Column('question_key', sa.String(length=128), nullable=False),
    sa.Column('value', sa.JSON(), nullable=False),
    sa.Column('submitted_at', sa.DateTime(timezone=True), nullable=False),
    sa.Column('took_ms', sa.Double(), nullable=True),
    sa.ForeignKeyConstraint(['episode_id'], ['episodes.id'], name=op.f('fk_answers_episode_id_episodes')),
    sa.ForeignKeyConstraint(['participant_id'], ['participants.id'], name=op.f('fk_answers_participant_id_participants')),
    sa.PrimaryKeyConstraint('id', name=op.f('pk_answers')),
    sa.UniqueConstraint('participant_id', 'step_key', 'question_key', name=op.f('uq_answers_participant_id_step_key_question_key'))
    )
    with op.batch_alter_table('answers', schema=None) as batch_op:
        batch_op.create_index(batch_op.f('ix_answers_episode_id'), ['episode_id'], unique=False)

    op.create_table('events',
    sa.Column('id', sa.Integer(), autoincrement=True, nullable=False),
    sa.Column('participant_id', sa.String(length=32), nullable=True),
    sa.Column('episode_id', sa.String(length=32), nullable=True),
    sa.Column('at', sa.DateTime(timezone=True), nullable=False),
    sa.Column('kind', sa.String(length=64), nullable=False),
    sa.Column('detail', sa.JSON(), nullable=False),
    sa.ForeignKeyConstraint(['episode_id'], ['episodes.id'], name=op.f('fk_events_episode_id_episodes')),
    sa.ForeignKeyConstraint(['participant_id'], ['participants.id'], name=op.f('fk_events_participant_id_participants')),
    sa.PrimaryKeyConstraint('id', name=op.f('pk_events'))
    )
    with op.batch_alter_table('events', schema=None) as batch_op:
        batch_op.create_index(batch_op.f('ix_events_episode_id'), ['episode_id'], unique=False)
        batch_op.create_index(batch_op.f('ix_events_participant_id'), ['participant_id'], unique=False)

    op.create_table('pauses',
    sa.Column('id', sa.Integer(), autoincrement=True, nullable=False),
    sa.Column('episode_id', sa.String(length=32), nullable=False),
    sa.Column('timestep', sa.Integer(), nullable=False),
    sa.Column('reason', sa.String(length=64), nullable=False),
    sa.Column('started_at', sa.DateTime(timezone=True), nullable=False),
    sa.Column('duration_ms', sa.Double(), nullable=True),
    sa.ForeignKeyConstraint(['episode_id'], ['episodes.id'], name=op.f('fk_pauses_episode_id_episodes')),
    sa.PrimaryKeyConstraint('id', name=op.f('pk_pauses')),
    sa.UniqueConstraint('episode_id', 'started_at', name=op.f('uq_pauses_episode_id_started_at'))
    )
    op.create_table('ticks',
    sa.Column('episode_id', sa.String(length=32), nullable=False),
    sa.Column('timestep', sa.Integer(), autoincrement=False, nullable=False),
    sa.Column('action_0', sa.SmallInteger(), nullable=True),
    sa.Column('action_1', sa.SmallInteger(), nullable=True),
    sa.Column('state_hash', sa.LargeBinary(length=8), nullable=False),
    sa.Column('reward_0', sa.SmallInteger(), nullable=False),
    sa.Column('reward_1', sa.SmallInteger(), nullable=False),
    sa.Column('shaped_0', sa.SmallInteger(), nullable=False),
    sa.Column('shaped_1', sa.SmallInteger(), nullable=False),
    sa.Column('events_0', sa.Integer(), nullable=False),
    sa.Column('events_1', sa.Integer(), nullable=False),
    sa.Column('next_action_0', sa.SmallInteger(), nullable=True),
    sa.Column('next_action_1', sa.SmallInteger(), nullable=True),
    sa.Column('prediction', sa.LargeBinary(length=72), nullable=True),
    sa.Column('displayed', sa.LargeBinary(length=24), nullable=False),
    sa.Column('late', sa.Boolean(), nullable=False),
    sa.Column('scheduled_ms', sa.Double(), nullable=False),
    sa.Column('late_ms', sa.Double(), nullable=False),
    sa.Column('models_ms', sa.Double(), nullable=False),
    sa.Column('key_seq_0', sa.BigInteger(), nullable=True),
    sa.Column('key_client_ms_0', sa.Double(), nullable=True),
    sa.Column('key_received_ms_0', sa.Double(), nullable=True),
    sa.Column('key_seq_1', sa.BigInteger(), nullable=True),
    sa.Column('key_client_ms_1', sa.Double(), nullable=True),
    sa.Column('key_received_ms_1', sa.Double(), nullable=True),
    sa.ForeignKeyConstraint(['episode_id'], ['episodes.id'], name=op.f('fk_ticks_episode_id_episodes')),
    sa.PrimaryKeyConstraint('episode_id', 'timestep', name=op.f('pk_ticks')),
    sqlite_with_rowid=False
    )


FIXED = ("id", "at", "actor", "action", "detail_hash", "hash")


def keep_audit_as_written() -> None:
    """Add triggers: entries of the audit log are never deleted, and their only change is that a detail is blanked."""
    changed = " OR ".join(f"NEW.{name} <> OLD.{name}" for name in FIXED)
    changed += " OR NEW.detail IS NOT NULL OR NEW.salt IS NOT NULL"
    if op.get_bind().dialect.name == "sqlite":
        refuse = "BEGIN SELECT RAISE(ABORT, 'the audit log cannot be changed'); END"
        op.execute(f"CREATE TRIGGER audit_keeps_entries BEFORE DELETE ON audit {refuse}")
        op.execute(f"CREATE TRIGGER audit_keeps_content BEFORE UPDATE ON audit WHEN {changed} {refuse}")
        return
    op.execute(
        "CREATE FUNCTION refuse_audit_change() RETURNS trigger LANGUAGE plpgsql AS "
        "$$ BEGIN RAISE EXCEPTION 'the audit log cannot be changed'; END $$"
    )
    refuse = "EXECUTE FUNCTION refuse_audit_change()"
    op.execute(f"CREATE TRIGGER audit_keeps_entries BEFORE DELETE ON audit FOR EACH ROW {refuse}")
    op.execute(f"CREATE TRIGGER audit_keeps_content BEFORE UPDATE ON audit FOR EACH ROW WHEN ({changed}) {refuse}")
