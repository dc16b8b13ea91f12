"""A page's Markdown as HTML: headings with anchors, code with colours, links resolved."""

from __future__ import annotations

from collections.abc import Sequence

from markdown_it import MarkdownIt
from markdown_it.token import Token
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import get_lexer_by_name
from pygments.util import ClassNotFound

from .links import Links, Page, slug

PLAIN = ("", "text", "mermaid")


def rendered(page: Page, links: Links) -> str:
    """The body of a page."""

    def coloured(code: str, language: str, _: str) -> str:
        if language in PLAIN:
            return ""
        try:
            lexer = get_lexer_by_name(language)
        except ClassNotFound:
            links.warnings.append(f"{page.source}: code in {language}, which nobody knows")
            return ""
        return str(highlight(code, lexer, HtmlFormatter(nowrap=True)))

    parser = MarkdownIt("commonmark", {"highlight": coloured, "html": True}).enable(
        ["table", "strikethrough"]
    )
    tokens = parser.parse(page.text)
    for before, token in zip([None, *tokens], tokens, strict=False):
        if before is not None and before.type == "heading_open":
            before.attrSet("id", slug(token.content))
        _resolve(token.children or (), page, links)
    return str(parser.renderer.render(tokens, parser.options, {}))


def _resolve(tokens: Sequence[Token], page: Page, links: Links) -> None:
    for token in tokens:
        for attribute in ("href", "src"):
            link = token.attrGet(attribute)
            if link is not None:
                token.attrSet(attribute, links.resolved(page, str(link)))
        _resolve(token.children or (), page, links)
