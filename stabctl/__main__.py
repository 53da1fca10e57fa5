"""python -m stabctl."""

from stabctl.cli import main

main()
