"""Sweeps: many simulations from one study file, on all cores or a cluster, with a results file that survives a crash.

Study file -> jobs     -> tasks -> rows (job, in processes (pool) or on Dask) -> results file
(TOML)     (study_file)  (sweep)                                             (results)
"""
