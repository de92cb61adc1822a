// Written by viewer/scripts/tables.py from the Python package, which has the same; not to be edited here.

/** Words for the allocator's status codes. */
export const STATUS = [
  "converged",
  "iteration limit",
  "zero force",
  "invalid force",
  "numerical failure",
  "clamped",
  "force reduced",
  "recovering",
  "pushing",
  "silent"
];

/** Kinds of moments: a word, a shape in a box of 12 x 12, and the tone of its colour. */
export const KINDS = {
  "phase": {
    "word": "phase",
    "shape": "M3 1.5L3 10.5M3 2L10 4.5L3 7",
    "tone": "info"
  },
  "command": {
    "word": "command",
    "shape": "M6 1.5Q10.5 1.5 10.5 6Q10.5 10.5 6 10.5Q1.5 10.5 1.5 6Q1.5 1.5 6 1.5Z",
    "tone": "good"
  },
  "fault": {
    "word": "fault",
    "shape": "M2 2L10 10M10 2L2 10",
    "tone": "bad"
  },
  "gap": {
    "word": "not measured",
    "shape": "M1 6L4 6M8 6L11 6",
    "tone": "warn"
  },
  "departure": {
    "word": "drone leaves",
    "shape": "M1.5 6L10.5 6M7 2.5L10.5 6L7 9.5",
    "tone": "bad"
  },
  "join": {
    "word": "drone joins",
    "shape": "M6 1.5L6 10.5M1.5 6L10.5 6",
    "tone": "good"
  },
  "change": {
    "word": "change",
    "shape": "M2 4L10 4M2 8L10 8",
    "tone": "good"
  },
  "descent": {
    "word": "descent",
    "shape": "M6 1.5L6 10.5M2.5 7L6 10.5L9.5 7",
    "tone": "bad"
  },
  "ground": {
    "word": "on the ground",
    "shape": "M1.5 10.5L10.5 10.5M6 1.5L6 8M3.5 5.5L6 8L8.5 5.5",
    "tone": "info"
  },
  "slack": {
    "word": "slack",
    "shape": "M1 4Q6 12 11 4",
    "tone": "warn"
  },
  "angle": {
    "word": "angle below limit",
    "shape": "M6 1.5L11 10.5L1 10.5Z",
    "tone": "warn"
  },
  "fallback": {
    "word": "fallback",
    "shape": "M6 1L11 6L6 11L1 6Z",
    "tone": "info"
  },
  "outcome": {
    "word": "end",
    "shape": "M2.5 2.5L9.5 2.5L9.5 9.5L2.5 9.5Z",
    "tone": "bad"
  }
};
export type Kind = keyof typeof KINDS;

/** Kinds that follow from others, and are many. */
export const FOLLOWING: ReadonlySet<Kind> = new Set(["angle", "fallback", "gap", "slack"] as const);

/** How a flight went, from good to bad. */
export type Level = "pass" | "warn" | "fail" | "lost";

/** Above so many drones no pair of cables is looked at. */
export const MOST_PAIRED = 64;
