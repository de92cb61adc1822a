"""Allocators judged on the forces of recorded flights: `asking` them, and `tables` of their answers."""

from colift.study.judge.asking import (
    ACTUAL,
    ON_BOARD,
    QUANTITIES,
    Answers,
    Judged,
    choose,
    judge,
    open_flight,
    parts_for,
    twin,
)
from colift.study.judge.tables import NOTE, findings, flight_tables, summary, tables

__all__ = [
    "ACTUAL",
    "NOTE",
    "ON_BOARD",
    "QUANTITIES",
    "Answers",
    "Judged",
    "choose",
    "findings",
    "flight_tables",
    "judge",
    "open_flight",
    "parts_for",
    "summary",
    "tables",
    "twin",
]
