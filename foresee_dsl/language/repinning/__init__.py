"""Updates clips and mutants after an edit of their parent: `repin` plans their new pins, `history` finds old versions
in git."""
