"""Saves a draft. Changes of two people to different parts of it become one text; where both changed a part, both texts
are kept and the second author chooses."""

import asyncio
from dataclasses import dataclass, replace
from typing import Final

from server.store import study_drafts
from server.store.database import Database
from server.store.study_drafts import MERGED, DraftConflict, DraftText, StudyDraft
from server.study.text_merge import TextConflict, merged

_TRIES: Final = 5  # others may save again while two texts are merged


@dataclass(frozen=True)
class MergeConflict:
    """What could not be saved: the newest draft, and the text with the changes of both in parts."""

    newest: StudyDraft
    parts: list[str | TextConflict]


async def save_merged(database: Database, draft: int, text: DraftText) -> StudyDraft | MergeConflict | None:
    """Save a text on top of the revision that it is based on, or together with what others have saved since. None:
    there is no such draft."""
    written = text
    for _ in range(_TRIES):
        saved = await database.write(study_drafts.save, draft, written)
        if not isinstance(saved, DraftConflict):
            return saved
        newest = saved.newest
        if written.base is None:
            return MergeConflict(newest, [TextConflict(newest.source, text.source)])
        parts = await asyncio.to_thread(merged, written.base, newest.source, written.source)
        if any(isinstance(part, TextConflict) for part in parts):
            break
        whole = "".join(str(part) for part in parts)
        written = replace(written, source=whole, based_on=newest.revision, base=newest.source, note=MERGED)
    else:
        parts = [TextConflict(newest.source, text.source)]
    await database.write(study_drafts.set_aside, draft, text)
    return MergeConflict(newest, parts)


async def base_of(database: Database, draft: int, base: str | None, before: str | None) -> str | None:
    """Return the text that an author's page and the server both had. `before`: what the page sent last, whose answer
    did not come; the server may have saved it."""
    if before is not None and await database.read(study_drafts.was_saved, draft, before):
        return before
    return base
