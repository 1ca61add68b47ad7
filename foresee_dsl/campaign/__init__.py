"""The whole method for many test cases: steps, workers, the store of results, findings, regression suites.

`foresee_dsl.campaign` is also the function of this name in `foresee_dsl.api`: a subpackage is an attribute of its
package, so that a function of the same name would be hidden by it.
"""

import sys
from importlib import import_module
from types import ModuleType


class _CallablePackage(ModuleType):
    """A package that can be called: `fs.campaign("scenarios", driver="pdm")`."""

    def __call__(self, *arguments: object, **options: object) -> object:
        """Call the function of the same name in `foresee_dsl.api`."""
        return import_module("foresee_dsl.api").campaign(*arguments, **options)


sys.modules[__name__].__class__ = _CallablePackage
