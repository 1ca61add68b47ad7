"""The codes of mistakes that show when files are joined: one entry each, with a wrong and a right example."""

from __future__ import annotations

from types import MappingProxyType

from foresee_dsl.language.codes import Code

# The same mistakes as within one file have the same codes (`codes.CODES` explains them).
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

_ALL = (
    Code(UNKNOWN_CASE, "no such case", "runner.foresee::r99", "runner.foresee::r02"),
    Code(WHICH_CASE, "the scenario has several cases", "foresee run runner.foresee", "foresee run runner.foresee::r02"),
    Code(UNKNOWN_MODEL, "no such model", "ego: car.sedna", "ego: car.sedan"),
    Code(WRONG_WAS, "the clip has another value than the change says", "change a.timing: 0.90 => 0.80", "1.00 => 0.80"),
    Code(BAD_CHANGE, "a change that cannot be made", "change a.steer: 0.00 => 1.70", "change a.steer: 0.00 => 0.70"),
    Code(MISSING_FILE, "no such file", 'use network "twon.foresee"', 'use network "town.foresee"'),
    Code(BAD_ADDRESS, "not an address", "runner.foresee::", "runner.foresee::r02"),
    Code(WRONG_KIND, "the file holds something else", 'use network "runner.foresee"', 'use network "town.foresee"'),
    Code(USES_ITSELF, "a file that uses itself", 'clip a of "a.foresee" ...', 'clip a of "runner.foresee" ...'),
    Code(TOO_DEEP, "too many parents, one above the other", "a clip of a clip of a clip ...", "a clip of a scenario"),
    Code(STALE_PIN, "the parent has changed since the child was made", "pin sha256:(of old)", "pin sha256:(of new)"),
    Code(UNKNOWN_SUFFIX, "a file of an unknown kind", 'use network "town.osm"', 'use network "town.net.xml"'),
    Code(OUTSIDE, "a file outside the project", 'use network "../../x.foresee"', 'use network "x.foresee"'),
    Code(DIFFERENT_KINDS, "two files that cannot be compared", "foresee diff clip.foresee town.foresee", "two clips"),
)

PROJECT_CODES = MappingProxyType({code.code: code for code in _ALL})
"""Every code of this side, by its name; see `codes.CODES` for the text side."""
