"""Every code of the language: what it means, why it is wrong, what to do, a wrong and a right example.

`FS0..` show in one file, `FS1..` when files are joined, `FS3..` are lints. Places that do not fit the network (`FS25.`)
are explained where they are found, in `compile.codes`; `report.codes.every_code` joins the two.
"""

from types import MappingProxyType

from foresee_dsl.language.codes import files, lints, projects
from foresee_dsl.language.codes.code import Code

CODES: MappingProxyType[str, Code] = MappingProxyType(
    {code.code: code for code in sorted((*files.CODES, *projects.CODES, *lints.CODES), key=lambda code: code.code)}
)
"""The codes of the text side, by name, in order."""

__all__ = ["CODES"]
