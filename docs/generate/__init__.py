"""Write the generated pages of docs/reference from the code: `python -m docs.generate`.

A test compares each page with what this would write. `docs/reference/dependencies.md` has a script of its own, because
it depends on the installed packages.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

from docs.generate.command_line import command_line
from docs.generate.scales import scales
from docs.generate.settings import settings
from docs.generate.study_keys import key_examples, section_page, study_keys
from docs.generate.training_settings import training_settings
from server.export import data_dictionary
from server.play import protocol_tables
from server.study.reference import EXAMPLES_FILE
from server.study.sections import SECTIONS

REFERENCE: Final = Path(__file__).resolve().parents[1] / "reference"


def protocol() -> str:
    """Return the protocol page with the tables of its fields as the message types are now."""
    return protocol_tables.render(protocol_tables.PAGE.read_text(encoding="utf-8"))


DATA: Final = {EXAMPLES_FILE: key_examples}  # what the server shows, too
PAGES: Final[dict[str, Callable[[], str]]] = {
    "settings.md": settings,
    "study_keys.md": study_keys,
    **{f"study_keys/{section.name}.md": partial(section_page, section) for section in SECTIONS},
    "scales.md": scales,
    "command_line.md": command_line,
    "training_settings.md": training_settings,
    "protocol.md": protocol,
    "data_dictionary.md": data_dictionary.text,
}
