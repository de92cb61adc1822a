"""Real flights become recordings: one file a log format, found by looking; see `base` for the contract."""

from colift.importing.base import Log, formats, read
from colift.importing.recording import Assumed, import_flight

__all__ = ["Assumed", "Log", "formats", "import_flight", "read"]
