from foresee_dsl.api import Conformance as Conformance
from foresee_dsl.api import Finding as Finding
from foresee_dsl.api import RunResult as RunResult
from foresee_dsl.api import TestCase as TestCase
from foresee_dsl.api import Verdict as Verdict
from foresee_dsl.api import assess as assess
from foresee_dsl.api import campaign as campaign
from foresee_dsl.api import conform as conform
from foresee_dsl.api import findings as findings
from foresee_dsl.api import load as load
from foresee_dsl.api import run as run

__version__: str
