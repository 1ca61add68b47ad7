"""The JSON documents that the commands of this plug-in print; see `foresee_dsl.cli.documents`."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from foresee_recordings.mined import Mined

DOCUMENTS: Mapping[str, Any] = MappingProxyType({"mine": Mined})
"""All documents by name, in the form that `foresee_dsl.documents.shape` takes."""
