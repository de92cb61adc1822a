"""Fly until a bound on the probability of a failure is certified, refuted, or the seeds are used up; write it down; do it once more."""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from colift.errors import ColiftError, MissionError, Problem
from colift.kernel.math import sequential
from colift.record.assumptions import largest
from colift.record.recording import atomic_path, versions
from colift.study.campaign.plan import Source, code_digest
from colift.study.certify import trials
from colift.study.certify.kept import Kept, keeping
from colift.study.certify.space import Space

FORMAT = "colift certificate 1"
CERTIFIED, REFUTED, OPEN = "certified", "refuted", "open"
Method = Literal["direct", "splitting"]
LEAST_SEEN = 5
"""Estimates by splitting that must have found failures, before anything is said of their mean."""
NEAR = 1e-6
"""Relative difference of quantities that another machine may round otherwise."""


@dataclass(frozen=True)
class Question:
    """What is to be certified, and how.

    Attributes
    ----------
    bound, confidence : float
        That fewer than this share of flights fail, with this confidence.
    first_seed, most : int
        First seed, and most flights (estimates, with splitting, all of which are made).
    limits : mapping
        Assumptions: the most of a quantity; a flight that goes beyond one fails.
    method : str
        ``"direct"`` or ``"splitting"``.
    particles, block
        Of splitting: number of flights that are split, and time after which random numbers are drawn anew, s.

    Raises
    ------
    MissionError
        For values outside of what is allowed.

    """

    bound: float = 0.01
    confidence: float = 0.95
    first_seed: int = 1_000_000
    most: int = 2000
    limits: Mapping[str, float] = field(default_factory=dict)
    method: Method = "direct"
    particles: int = 32
    block: float = 1.0

    def __post_init__(self) -> None:
        allowed = {
            "bound": (0.0 < self.bound < 1.0, "between 0 and 1"),
            "confidence": (0.5 < self.confidence < 1.0, "between 0.5 and 1"),
            "first_seed": (1 <= self.first_seed < 2**62, "from 1 on: 0 starts as the mission says"),
            "most": (1 <= self.most <= 10_000_000, "from 1 to 10000000"),
            "method": (self.method in ("direct", "splitting"), "direct or splitting"),
            "particles": (2 <= self.particles <= 10_000, "from 2 to 10000"),
            "block": (0.0 < self.block <= 1e6, "above 0"),
            **{f"limits.{k}": (0.0 < v < math.inf, "above 0") for k, v in self.limits.items()},
        }
        found = [
            Problem(name, f"{getattr(self, name, '')}", f"must be {text}")
            for name, (good, text) in allowed.items()
            if not good
        ]
        if found:
            raise MissionError("certificate", found)

    @property
    def seeds(self) -> range:
        """All that may be flown."""
        return range(self.first_seed, self.first_seed + self.most)


def certify(
    space: Space,
    question: Question,
    *,
    sources: Sequence[Source] = (),
    workers: int | None = None,
    told: trials.Told = lambda _done, _failed: None,
    part: Path | None = None,
) -> dict[str, Any]:
    """Fly, and hand back the certificate.

    Parameters
    ----------
    space, question, sources, workers
        What is flown, what is asked, files of parts, and how many flights at a time.
    told
        Called after each trial.
    part
        File that keeps trials until all are done; one that is there is gone on from, whatever the bound and the range of seeds were then.

    Raises
    ------
    ColiftError
        If a flight ends in an error, or the file is of something else.

    """
    direct = question.method == "direct"
    ask, make = (_direct, trials.Trial) if direct else (_splitting, trials.Replica)
    common = {
        "vary": {path: list(ends) for path, ends in space.vary.items()}, "digest": space.digest, "code": code_digest(),
        "parts": {source.name: _digest(source) for source in sources}, "versions": versions(),
    }  # fmt: skip
    asked = asdict(question)
    same = ("limits", "method") if direct else ("limits", "method", "particles", "block")
    about = {"format": f"{FORMAT}, trials", **{name: asked[name] for name in same}, **common}
    with keeping(part, about, make) as kept:
        answer = ask(space, question, sources, workers, told, kept)
    return {
        "format": FORMAT, "statement": statement(space, question, answer), "question": asked, **answer, **common,
        "mission": space.mission,
    }  # fmt: skip


def _digest(source: Source) -> str:
    import hashlib

    return hashlib.sha256(source.text.encode()).hexdigest()


def verdict(failures: int, flights: int, bound: float, confidence: float) -> str:
    """What so many failures of so many flights say; may be asked after every flight (:mod:`colift.kernel.math.sequential`)."""
    enough = -math.log(1.0 - confidence)
    if sequential.evidence_below(failures, flights, bound) >= enough:
        return CERTIFIED
    return REFUTED if sequential.evidence_above(failures, flights, bound) >= enough else OPEN


def _direct(
    space: Space, question: Question, sources: Sequence[Source], workers: int | None, told: trials.Told, kept: Kept[Any]
) -> dict[str, Any]:  # fmt: skip
    failed: list[dict[str, Any]] = []
    worst: dict[str, float] = {}
    flights, result = 0, OPEN
    flown = trials.fly(
        space, question.seeds, question.limits, sources=sources, workers=workers, kept=kept
    )
    for flights, trial in enumerate(flown, 1):
        worst = largest(worst, trial.worst)
        if trial.reason:
            failed.append({"seed": trial.seed, "reason": trial.reason})
        told(flights, len(failed))
        result = verdict(len(failed), flights, question.bound, question.confidence)
        if result != OPEN:
            break
    flown.close()
    ends = sequential.interval(len(failed), flights, question.confidence)
    return {
        "result": result, "exact": True, "flights": flights, "failures": failed, "interval": list(ends), "worst": worst,
    }  # fmt: skip


def _splitting(
    space: Space, question: Question, sources: Sequence[Source], workers: int | None, told: trials.Told, kept: Kept[Any]
) -> dict[str, Any]:  # fmt: skip
    found: list[trials.Replica] = []
    made = trials.split(
        space, question.seeds, question.limits, particles=question.particles, block=question.block, sources=sources,
        workers=workers, kept=kept,
    )  # fmt: skip
    for replica in made:
        found.append(replica)
        told(len(found), sum(each.probability > 0.0 for each in found))
    found.sort()
    values = [each.probability for each in found]
    mean, ends = statistics.fmean(values), mean_limits(values, question.confidence)
    result = OPEN
    if ends is not None and ends[1] < question.bound:
        result = CERTIFIED
    elif ends is not None and ends[0] > question.bound:
        result = REFUTED
    return {
        "result": result, "exact": False, "probability": mean, "interval": None if ends is None else list(ends),
        "estimates": [{"seed": each.seed, "probability": each.probability} for each in found],
        "blocks": sum(each.blocks for each in found), "worst": largest(*(each.worst for each in found)),
    }  # fmt: skip


def mean_limits(values: Sequence[float], confidence: float) -> tuple[float, float] | None:
    """Ends of the mean's interval by Student, each with ``confidence``, as good as the central limit theorem; None where too few are above 0."""
    if sum(value > 0.0 for value in values) < LEAST_SEEN:
        return None
    mean, count = statistics.fmean(values), len(values)
    half = sequential.student(confidence, count - 1) * statistics.stdev(values) / math.sqrt(count)
    return max(mean - half, 0.0), mean + half


def statement(space: Space, question: Question, answer: Mapping[str, Any]) -> str:
    """What is certified, in words."""
    name, bound, sure = space.mission["name"], question.bound, f"{100 * question.confidence:g} %"
    what = f'a flight of "{name}" as drawn here fails with a probability'
    based = (
        f"{len(answer['failures'])} of {answer['flights']} flights failed"
        if answer["exact"]
        else f"mean of {len(answer['estimates'])} estimates by splitting {answer['probability']:.3g}; the confidence is asymptotic"
    )
    if answer["result"] == OPEN:
        return (
            f"Open: whether {what} below {bound:g} is not known with {sure} confidence ({based})."
        )
    side = "below" if answer["result"] == CERTIFIED else "above"
    return f"{answer['result'].capitalize()}: {what} {side} {bound:g}, with {sure} confidence ({based})."


def save(certificate: Mapping[str, Any], path: Path) -> Path:
    """Write a certificate, whole or not at all."""
    with atomic_path(path) as temporary:
        text = json.dumps(certificate, indent=2, allow_nan=False)
        temporary.write_text(text + "\n", encoding="utf-8")
    return path


def read(path: Path) -> dict[str, Any]:
    """A certificate from its file.

    Raises
    ------
    ColiftError
        For a file that is none, is of another version, or was changed since.

    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ColiftError(f"{path}: is no certificate ({error})") from error
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        said = found.get("format") if isinstance(found, dict) else None
        raise ColiftError(f"{path}: format is {said!r}, must be {FORMAT!r}")
    try:
        space, question = _space_of(found), Question(**found["question"])
        told = statement(space, question, found)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ColiftError(f"{path}: is no whole certificate ({error!r})") from error
    if space.digest != found["digest"]:
        raise ColiftError(f"{path}: mission or ranges are not those of its digest; it was changed")
    if told != found["statement"]:
        raise ColiftError(f"{path}: says other than its numbers do; it was changed")
    return found


def _space_of(found: Mapping[str, Any]) -> Space:
    vary = {path: (float(low), float(high)) for path, (low, high) in found["vary"].items()}
    return Space(found["mission"], vary)


def check(
    found: Mapping[str, Any],
    *,
    sources: Sequence[Source] = (),
    workers: int | None = None,
    told: trials.Told = lambda _done, _failed: None,
) -> list[str]:
    """Fly a certificate's flights once more; what came out otherwise, in words.

    Raises
    ------
    ColiftError
        If parts that it was flown with are missing, or a flight ends in an error.

    """
    given = {source.name: _digest(source) for source in sources}
    if given != found["parts"]:
        needed = ", ".join(found["parts"]) or "none"
        raise ColiftError(
            f"the certificate was flown with these files of parts: {needed}; name the same with --with"
        )
    again = certify(_space_of(found), Question(**found["question"]), sources=sources, workers=workers, told=told)  # fmt: skip
    names = ("result", "flights", "failures", "estimates", "interval", "probability")
    pairs = {name: (again[name], found[name]) for name in names if name in found}
    pairs |= {name: (again["worst"].get(name), value) for name, value in found["worst"].items()}
    differs = [
        f"{name}: {_short(now)} now, {_short(before)} before"
        for name, (now, before) in pairs.items()
        if not _same(now, before)
    ]
    if differs and again["code"] != found["code"]:
        differs.append(
            f"colift's sources are others now ({again['code']}) than they were ({found['code']})"
        )
    return differs


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, float) and isinstance(b, int | float):
        return math.isclose(a, b, rel_tol=NEAR, abs_tol=1e-12)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(_same, a, b))
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(_same(a[key], b[key]) for key in a if key != "reason")
    return bool(a == b)


def _short(value: Any) -> str:
    return f"{len(value)} of them" if isinstance(value, list) and len(value) > 2 else f"{value}"
