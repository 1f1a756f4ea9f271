"""The metadata, status values and key types that all tables share."""

from sqlalchemy import MetaData, String

metadata = MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "ck": "ck_%(table_name)s_%(constraint_name)s",
        "fk": "fk_%(table_name)s_%(column_0_N_name)s_%(referred_table_name)s",
        "pk": "pk_%(table_name)s",
    }
)

PARTICIPANT_STATUSES = ("active", "completed", "screened_out", "withdrawn", "timed_out", "returned")
EPISODE_STATUSES = ("new", "running", "done", "aborted")
ROLES = ("watch", "act", "own")  # of researchers, each with the rights of those before it
RECRUITMENT_ID = "recruitment_id"  # key in `personal` of the recruiter's id of a person: one row per person and study


ID = String(32)
KEY = String(128)
SHA256 = String(64)
PARTICIPANT = "participants.id"
EPISODE = "episodes.id"
