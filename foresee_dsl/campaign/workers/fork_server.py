"""Sets up the fork server, which alone imports this module, so that orphans of workers are found and ended."""

from __future__ import annotations

import warnings

from foresee_dsl.campaign.workers.processes import adopt_orphans

adopt_orphans()
# Python's fork server (3.11 to 3.13) reaps an orphaned process as it should, but warns that it did not start it.
warnings.filterwarnings("ignore", message="forkserver: waitpid returned unexpected pid")
