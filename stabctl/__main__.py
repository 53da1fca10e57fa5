"""python -m stabctl."""

from .cli import main

main()
