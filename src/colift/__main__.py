"""`python -m colift` is the `colift` command."""

from colift.cli import main

main()
