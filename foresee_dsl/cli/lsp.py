"""The command `foresee lsp`: the language server that editors start."""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

from foresee_dsl.cli.common import FAILED

_LOCAL = "127.0.0.1"
"""The server reads the files that a client names, so that nobody outside this machine may ask it."""


def lsp(
    tcp: Annotated[
        int | None, typer.Option("--tcp", min=1, max=65535, help="Listen on this port of this machine.")
    ] = None,
) -> None:
    """Start the language server, for editors; they speak to it over standard input and output.

    [dim]foresee lsp
    foresee lsp --tcp 9257[/dim]
    """
    try:
        from foresee_dsl.editor.server import make_server
    except ImportError as error:
        if error.name is None or error.name.partition(".")[0] not in ("pygls", "lsprotocol"):
            raise
        typer.echo("error: the language server needs pygls: pip install 'foresee-dsl[lsp]'", err=True)
        raise typer.Exit(FAILED) from None
    server = make_server()
    if tcp is not None:
        typer.echo(f"foresee lsp listens on {_LOCAL}:{tcp}", err=True)
        server.start_tcp(_LOCAL, tcp)
        return
    # The protocol has standard output for itself: whatever else prints there goes to standard error.
    protocol = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    server.start_io(stdout=protocol)
