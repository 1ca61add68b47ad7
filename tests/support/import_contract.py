"""An import contract of our own: no file and no folder imports itself by way of others, imports inside functions
included, and calls of `import_module` with a module's name."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import networkx as nx
from grimp import ImportGraph
from importlinter import Contract, ContractCheck, fields, output


class NoCircles(Contract):  # type: ignore[misc]  # import-linter has no types for it
    """Breaks where files of a package import each other in a circle, or where what lies in one folder (its subfolders
    as wholes, and its files) does.

    `facades`: imports that may close a circle, as the importing package only passes on the names of the other when one
    of them is used.
    """

    package = fields.StringField()
    facades = fields.SetField(subfield=fields.ImportExpressionField(), required=False, default=set())

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:
        """Look for strongly connected groups of files, and in each folder for imports that close a circle."""
        files = sorted({self.package} | graph.find_descendants(self.package))
        for importer, imported in imports_by_name(self.package):
            graph.add_import(importer=importer, imported=imported)
        missing = []
        for importer, imported in sorted((i.importer.expression, i.imported.expression) for i in self.facades):
            if graph.direct_import_exists(importer=importer, imported=imported):
                graph.remove_import(importer=importer, imported=imported)
            else:
                missing.append(f"{importer} -> {imported}")
        imports = nx.DiGraph((name, other) for name in files for other in graph.find_modules_directly_imported_by(name))
        circles = [sorted(group) for group in nx.strongly_connected_components(imports) if len(group) > 1]
        closing = {folder: sorted(graph.nominate_cycle_breakers(folder)) for folder in files}
        folders = {folder: pairs for folder, pairs in closing.items() if pairs}
        return ContractCheck(
            kept=not (circles or folders or missing),
            metadata={"circles": circles, "folders": folders, "missing": missing},
        )

    def render_broken_contract(self, check: ContractCheck) -> None:
        """Name the files of each circle, the imports that close circles of folders, and facades that are listed but
        import nothing."""
        for circle in check.metadata["circles"]:
            output.print_error("a circle: " + ", ".join(circle))
        for folder, imports in check.metadata["folders"].items():
            output.print_error(f"circles in the folder {folder}, closed by:")
            for importer, imported in imports:
                output.print_error(f"  {importer} -> {imported}")
        for facade in check.metadata["missing"]:
            output.print_error("a facade that does not exist: " + facade)


def imports_by_name(package: str) -> Iterator[tuple[str, str]]:
    """Yield the calls of `import_module` with the name of a module of a package: the file's module, and that module."""
    spec = find_spec(package)
    for folder in (spec.submodule_search_locations if spec is not None else None) or ():
        for path in Path(folder).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            if "import_module(" in text:
                parts = (package, *path.relative_to(folder).with_suffix("").parts)
                name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
                yield from ((name, other) for other in _names(ast.parse(text)) if other.split(".")[0] == package)


def _names(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        match node:
            case ast.Call(
                func=ast.Name(id="import_module") | ast.Attribute(attr="import_module"),
                args=[ast.Constant(value=str(name)), *_],
            ):
                yield name
