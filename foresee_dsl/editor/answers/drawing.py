"""Answers the editor's request `foresee/draw`: draws a file from the texts that the editor holds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from foresee_dsl.editor.protocol.rpc import Json


def picture(path: Path, overlay: Mapping[Path, str], params: Json) -> Json:
    """Return the picture of a file with the editor's texts, or its errors (see `report.picture.answer`)."""
    from foresee_dsl.report.picture.answer import answer

    return answer(
        path,
        overlay,
        case=str(params.get("case") or ""),
        width=float(params.get("width") or 720),
        whole=bool(params.get("whole")),
    )


def page(nonce: str) -> str:
    """Return the page that shows pictures; `nonce` is the nonce of the web view's scripts and styles."""
    from foresee_dsl.report.picture.answer import page_of

    return page_of(nonce, title="foresee", connect="")
