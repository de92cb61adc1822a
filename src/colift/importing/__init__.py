"""Real flights become recordings: one file a log format, found by looking; see `base` for the contract."""

from colift.importing._recording import Assumed, import_flight
from colift.importing.base import Log, formats, read

__all__ = ["Assumed", "Log", "formats", "import_flight", "read"]
