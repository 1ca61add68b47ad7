"""The page that shows pictures as they come: of the language server in a web view, or of `foresee draw --watch`."""

from __future__ import annotations

from foresee_dsl.files import data_folder, rendered


def page_of(nonce: str, *, title: str, connect: str) -> str:
    """Return the page; it loads nothing, and asks for pictures at the address `connect` ("": its host sends them).

    Its scripts and styles have the nonce, which its content security policy names.
    """
    folder = data_folder("templates") / "draw"
    return rendered(
        "draw/page.html",
        nonce=nonce,
        title=title,
        connect=connect,
        script=(folder / "page.js").read_text(encoding="utf-8"),
        style=(folder / "page.css").read_text(encoding="utf-8"),
    )
