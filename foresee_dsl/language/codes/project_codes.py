"""The codes of mistakes that show when files are joined; `registry.projects` explains them."""

from __future__ import annotations

# The same mistakes as within one file have the same codes (`registry.files` explains them).
UNKNOWN_PROPERTY = "FS006"
UNKNOWN_PARAMETER = "FS031"
MISFIT = "FS032"
NO_NETWORK = "FS036"
UNKNOWN_ACTOR = "FS037"
WRONG_CLASS = "FS038"
EMPTY_WINDOW = "FS039"
INCOMPLETE_CLIP = "FS044"

UNKNOWN_CASE = "FS100"
WHICH_CASE = "FS103"
UNKNOWN_MODEL = "FS110"
WRONG_WAS = "FS123"
BAD_CHANGE = "FS124"
MISSING_FILE = "FS130"
BAD_ADDRESS = "FS131"
WRONG_KIND = "FS132"
USES_ITSELF = "FS133"
TOO_DEEP = "FS134"
STALE_PIN = "FS135"
UNKNOWN_SUFFIX = "FS137"
OUTSIDE = "FS138"
DIFFERENT_KINDS = "FS140"

TOO_FEW_DRAWS = "FS104"
NOT_IN_PARENT = "FS126"
ALREADY_IN_PARENT = "FS127"
