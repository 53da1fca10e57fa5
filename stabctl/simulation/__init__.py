"""Time simulation: what happens (events), the compiled stepper, the run, its outcome and trajectory."""
