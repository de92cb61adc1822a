"""Real flights become recordings: one file a log format, found by looking; see `base` for the contract."""

from colift.record.importing._recording import Assumed, import_flight
from colift.record.importing.base import Finding, Log, Reading, formats, read

__all__ = ["Assumed", "Finding", "Log", "Reading", "formats", "import_flight", "read"]
