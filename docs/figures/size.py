"""What `colift size` answers: ``python docs/figures/size.py`` writes it into the pages, with ``--fly`` asked anew first."""

import os
import shlex
import subprocess
import sys

from pages import fill, stored

QUESTIONS = {
    "carries": "--mass 1.4 --max-thrust 28 --drones 3 --cable 2 --load 1.2 --wind 8",
    "how-many": "--mass 1.4 --max-thrust 28 --cable 2 --load 5",
    "lost": "--vehicle x500 --drones 4 --cable 2 --load 1.5 --wind 6 --fly --seeds 10",
}
RIGID = {"box": "--vehicle x500 --load 2 --box 0.8 0.6 0.3"}
SHORT = {"how-many": ("Fewest", "How long"), "lost": ("1.5 kg", "Fewest")}
"""Of what the front page shows less, from a line that begins so to the one before another."""
WIDTH = 100


def ask(arguments):
    """What the command prints."""
    done = subprocess.run(
        [sys.executable, "-m", "colift", "size", *shlex.split(arguments)],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"COLUMNS": str(WIDTH)},
    )
    return [line.rstrip() for line in done.stdout.splitlines()]


def between(lines, first, end):
    """Lines from the one that begins with a text to the one before the next that begins with another."""
    begin = next(i for i, line in enumerate(lines) if line.startswith(first))
    stop = next(i for i, line in enumerate(lines) if i > begin and line.startswith(end))
    return lines[begin:stop]


def shown(arguments, lines):
    """A command and what it prints, for a page."""
    said = "\n".join(line for i, line in enumerate(lines) if line or (i and lines[i - 1]))
    return f"```text\n$ colift size {arguments}\n{said.rstrip()}\n```"


def main():
    answers = stored(
        __file__, lambda: {name: ask(each) for name, each in (QUESTIONS | RIGID).items()}
    )
    for name, question in QUESTIONS.items():
        fill("your-drones.md", name, shown(question, answers[name]))
    for name, question in RIGID.items():
        fill("rigid-loads.md", name, shown(question, answers[name]))
    parts = []
    for name, question in QUESTIONS.items():
        lines = answers[name]
        if name in SHORT:
            lines = between(lines, *SHORT[name])
        if name == "lost":
            lines += between([*answers[name], "."], "Flown", ".")
        parts.append(shown(question, lines))
    fill("../README.md", "questions", "\n\n".join(parts))


if __name__ == "__main__":
    main()
