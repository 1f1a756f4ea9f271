"""What a command of `training` says about an error that stops it."""


def error_message(error: Exception) -> str:
    """Return the message of an error. An error of the operating system, such as a full disk, gets place and remedy."""
    if not isinstance(error, OSError) or error.errno is None:  # our own have both
        return str(error)
    place = f"{error.filename}: " if error.filename else ""
    remedy = "Check this path and the free space of its disk, then run the same command again: it continues."
    return f"{place}{error.strerror}. {remedy}"


def refuse_below(least: int, **options: int) -> None:
    """Raise ValueError for the first option whose number is too small."""
    for name, value in options.items():
        if value < least:
            raise ValueError(f"--{name} {value}: must be at least {least}.")
