"""The reproduction of the 2022 paper: what it prints, records of our studies, and the page that compares them.

It is used by the studies in `analysis/` and `sims/`, and is not part of the wheel.
"""
