"""The reproduction of the 2022 paper: what it prints, records of our studies, and the page that compares them.

The studies in `analysis/` and `sims/` use it. It is no part of the wheel.
"""
