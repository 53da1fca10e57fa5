"""Control laws of the storage devices.

A law is a frozen record derived from `Law`, with `par(device)`, its constants; the file that defines it has its
equations: a device with the role "controller" whose `step` gives the order of a storage device. A law that remembers
something reads its last output y, which begins as START of that file. A new law is one file.
"""

from .bang_bang import BangBang
from .controller import Controller
from .feedback import Feedback
from .law import Law, SampledLaw, decided
from .python_law import Seen
from .signals import Input, StorageDevice
from .storage_law import StorageLaw
from .timing import Gate

__all__ = [
    "BangBang",
    "Controller",
    "Feedback",
    "Gate",
    "Input",
    "Law",
    "SampledLaw",
    "Seen",
    "StorageDevice",
    "StorageLaw",
    "decided",
]
