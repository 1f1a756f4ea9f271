"""Markdown of study files as HTML."""

import pytest

from server.web.markdown import MARKDOWN


@pytest.mark.parametrize(
    ("text", "html"),
    [
        ("它们显示很可能会做、\n但实际不会做的动作。", "它们显示很可能会做、但实际不会做的动作。"),
        ("它们是**故意错误**\n的：", "它们是<strong>故意错误</strong>的："),
        ("They show what is likely\nand not done.", "They show what is likely\nand not done."),
        ("由 AI\n厨师来做", "由 AI\n厨师来做"),
        ("第一行  \n第二行", "第一行<br />\n第二行"),
    ],
)
def test_the_end_of_a_line_between_chinese_characters_is_not_shown_as_a_space(text: str, html: str) -> None:
    assert MARKDOWN.render(text) == f"<p>{html}</p>\n"


def test_html_is_shown_as_text() -> None:
    assert MARKDOWN.render("<b>x</b>") == "<p>&lt;b&gt;x&lt;/b&gt;</p>\n"
