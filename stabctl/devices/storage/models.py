"""How storage is connected: as the ideal device, or behind a converter."""

from typing import Literal

StorageModel = Literal["ideal", "regc", "regc_c", "regfm"]
TABLES = {"ideal": "esd", "regc": "esd_regc", "regc_c": "esd_regc_c", "regfm": "esd_regfm"}  # model -> device
