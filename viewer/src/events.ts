// Kinds of events: each has a word and a shape of its own, so that none is told by its colour alone.

export type Kind = "slack" | "fallback" | "fault" | "angle" | "command";

export interface Mark {
  time: number;
  kind: Kind;
  text: string;
  drone: number | null;
}

export const KINDS: Record<Kind, { word: string; shape: string }> = {
  fault: { word: "fault", shape: "M2 2l8 8M10 2l-8 8" },
  slack: { word: "slack", shape: "M1 4q5 8 10 0" },
  angle: { word: "angle below limit", shape: "M6 1.5l5 9H1z" },
  fallback: { word: "fallback", shape: "M6 1l5 5-5 5-5-5z" },
  command: { word: "command", shape: "M6 1.5a4.5 4.5 0 1 0 0 9 4.5 4.5 0 0 0 0-9z" },
};

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
];
