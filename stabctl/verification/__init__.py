"""Published numbers of known systems beside those computed here.

`systems.toml` says where the data of each system are, under which conventions its numbers were computed and why some
differ; `published.csv` has the numbers, copied from their sources; `cases` has systems that may be passed on.
"""

from .compare import Comparison, Verification, verify

__all__ = ["Comparison", "Verification", "verify"]
