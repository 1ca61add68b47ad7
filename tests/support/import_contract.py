"""An import contract of our own: no file imports itself by way of others, imports inside functions included."""

from __future__ import annotations

import networkx as nx
from grimp import ImportGraph
from importlinter import Contract, ContractCheck, fields, output


class NoCircles(Contract):  # type: ignore[misc]  # import-linter has no types for it
    """Breaks where files of a package import each other in a circle."""

    package = fields.StringField()

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:
        """Look for strongly connected groups of files."""
        files = [name for name in graph.modules if name.split(".")[0] == self.package]
        imports = nx.DiGraph((name, other) for name in files for other in graph.find_modules_directly_imported_by(name))
        circles = [sorted(group) for group in nx.strongly_connected_components(imports) if len(group) > 1]
        return ContractCheck(kept=not circles, metadata={"circles": circles})

    def render_broken_contract(self, check: ContractCheck) -> None:
        """Name the files of each circle."""
        for circle in check.metadata["circles"]:
            output.print_error("a circle: " + ", ".join(circle))
