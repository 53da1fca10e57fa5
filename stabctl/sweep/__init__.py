"""Many runs from one study file, on all cores or on a cluster, into one results file that survives being killed.

Study file -> jobs -> tasks -> rows (pool of processes, or Dask) -> results file
(TOML)        (study)  (task)  (perform)                            (store)
"""
