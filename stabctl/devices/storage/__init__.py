"""Storage devices, each as the ideal device or behind a converter."""

from typing import Literal

StorageModel = Literal[
    "ideal", "regc", "regc_b", "regc_c", "regc_repc", "regc_b_repc", "regc_c_repc", "regfm", "regfm_b1"
]
TABLES = {  # model -> device
    "ideal": "esd",
    "regc": "esd_regc",
    "regc_b": "esd_regc_b",
    "regc_c": "esd_regc_c",
    "regc_repc": "esd_regc_repc",
    "regc_b_repc": "esd_regc_b_repc",
    "regc_c_repc": "esd_regc_c_repc",
    "regfm": "esd_regfm",
    "regfm_b1": "esd_regfm_b1",
}
