"""Mutated inputs: each must end in a result or in one sentence. `python -m fuzz` runs for long (`make fuzz`)."""
