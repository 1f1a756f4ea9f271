"""Markdown of study files as HTML."""

import re
from collections.abc import Sequence
from typing import Any, Final

from markdown_it import MarkdownIt
from markdown_it.token import Token

# Characters of scripts without spaces between words: Chinese and Japanese, with their punctuation.
_WITHOUT_SPACES: Final = re.compile(r"[\u3000-\u30ff\u3400-\u9fff\uf900-\ufaff\uff00-\uffef]")


def _line_break(_renderer: Any, tokens: Sequence[Token], index: int, _options: Any, _env: Any) -> str:
    """Return what stands for the end of a line in a paragraph: browsers show it as a space, which is wrong between two
    Chinese characters."""
    before = next((one.content[-1] for one in reversed(tokens[:index]) if one.content), "")
    after = next((one.content[0] for one in tokens[index + 1 :] if one.content), "")
    return "" if _WITHOUT_SPACES.match(before) and _WITHOUT_SPACES.match(after) else "\n"


MARKDOWN = MarkdownIt("commonmark", {"html": False}).enable("table")
MARKDOWN.add_render_rule("softbreak", _line_break)
