"""The searches by name."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from foresee_study.search.av_fuzzer import AvFuzzer
from foresee_study.search.protocol import Search
from foresee_study.search.samota import Samota
from foresee_study.search.sampling import Bandit, CrossEntropy

SEARCHES: Mapping[str, Search] = MappingProxyType(
    {search.name: search for search in (AvFuzzer(), Samota(), CrossEntropy(), Bandit())}
)
