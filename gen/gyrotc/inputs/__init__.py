"""How gyrotc opens what it is given: regular files only, within ceilings that a user can move, as one clear refusal.

Second room of the house (errors → **inputs** → data set → ...). Every reader of a file that somebody else may have
written goes through here. docs/recordings.md, section 8, has the ceilings for users.
"""

from .ceilings import CEILINGS, ceiling, need_memory, refuse_above, set_ceilings
from .opening import open_input, read_input
from .texts import checked, parse_json, parse_toml, read_json, read_toml

__all__ = [
    "CEILINGS",
    "ceiling",
    "checked",
    "need_memory",
    "open_input",
    "parse_json",
    "parse_toml",
    "read_input",
    "read_json",
    "read_toml",
    "refuse_above",
    "set_ceilings",
]
