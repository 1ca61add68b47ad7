"""Test cases as files for a campaign's workers."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path

from foresee_dsl.campaign.steps.inputs import CaseRef, Ref
from foresee_dsl.campaign.storage.traces import Blobs
from foresee_dsl.language.project.document import TestCase


class CaseFiles:
    """Puts test cases where workers find them. What is run is what was loaded, also when its file is edited meanwhile.

    The files are pickles: they are for processes of this campaign alone, and are deleted with its working folder.
    """

    def __init__(self, folder: Path) -> None:
        self._blobs = Blobs(folder)
        self._refs: dict[str, CaseRef] = {}
        self._shared: dict[int, tuple[object, Ref]] = {}

    def ref(self, case: TestCase) -> CaseRef:
        """Return the reference of a test case, writing it if it is new."""
        if case.id not in self._refs:
            own = replace(case, document=None, network=Path(), models={})
            self._refs[case.id] = CaseRef(self._put(own), self._shared_ref(case))
        return self._refs[case.id]

    def _shared_ref(self, case: TestCase) -> Ref:
        # By identity first: the cases of a project share the network's object, and pickling it takes a while.
        known = self._shared.get(id(case.network))
        if known is None or known[0] is not case.network or isinstance(case.network, Path):
            self._shared[id(case.network)] = known = (case.network, self._put((case.network, dict(case.models))))
        return known[1]

    def _put(self, value: object) -> Ref:
        name = self._blobs.put(pickle.dumps(value))
        return Ref(name, self._blobs.path(name))
