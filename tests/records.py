"""The records of the packaged devices by name: `from records import genrou, sexs`."""

from stabctl import devices


def __getattr__(name):
    try:
        return devices.every()[name]
    except KeyError:
        raise AttributeError(name) from None
