"""Errors of a database that cannot be used now."""


class DatabaseDown(Exception):
    """The database cannot be reached or cannot commit (stopped, locked, disk full, input/output error)."""


class DatabaseInUse(DatabaseDown):
    """Another server has this database open."""
