"""The paper's problem: its Newton steps and its optimum."""
