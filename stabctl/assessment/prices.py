"""Prices of what may help a system: storage, other dispatch, retuned stabilizers; given, or of a TOML file."""

import math
from dataclasses import dataclass, fields
from pathlib import Path

from stabctl._util import files, toml_file
from stabctl._util.errors import StudyError, shown
from stabctl.placement.siting import Costs


@dataclass(frozen=True)
class Prices:
    """Prices, all in the same currency; what has no price has no cost.

    Parameters
    ----------
    storage_mw : float, optional
        Price of a MW of storage.
    storage_mwh, storage_site : float
        Prices of a MWh of storage and of a site, which count beside that of a MW.
    redispatch_mwh : float, optional
        Price of a MWh that other machines produce.
    hours : float
        Hours per year with the other dispatch; the cost is that of a year. Default 8760.
    stabilizer : float, optional
        Price of retuning a stabilizer.
    currency : str
        What the currency is called: "EUR".

    Raises
    ------
    StudyError
        If a price is not a number of at least 0.

    Examples
    --------
    >>> prices = st.Prices(storage_mw=300e3, storage_site=1e6, redispatch_mwh=20, hours=500, currency="EUR")
    >>> prices.costs
    Costs(mw=300000.0, site=1000000.0, mwh=0.0)
    """

    storage_mw: float | None = None
    storage_mwh: float = 0.0
    storage_site: float = 0.0
    redispatch_mwh: float | None = None
    hours: float = 8760.0
    stabilizer: float | None = None
    currency: str = ""

    def __post_init__(self) -> None:
        for name in (f.name for f in fields(self) if f.name != "currency"):
            value = getattr(self, name)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if value is not None and not (number and 0 <= value < math.inf):
                raise StudyError(f"The price {name} = {shown(value)} is not allowed; give a number of at least 0.")
        if not isinstance(self.currency, str):
            raise StudyError(f"The currency {shown(self.currency)} is not a text; give 'EUR', for example.")

    @property
    def costs(self) -> Costs | None:
        """What storage costs, as in `place`; None without a price of a MW."""
        return None if self.storage_mw is None else Costs(self.storage_mw, self.storage_site, self.storage_mwh)


def prices(given: Prices | str | Path | None) -> Prices:
    """The prices that are given: a record, or a TOML file with a table [prices]; none without.

    Raises `StudyError` with file, key and value of the first error.
    """
    if given is None or isinstance(given, Prices):
        return given or Prices()
    path = files.path_of(given)
    content = toml_file.read(path, "file of prices")
    known = [f.name for f in fields(Prices)]
    table = content.pop("prices", None)
    if content:
        raise StudyError(f"{path}: {toml_file.unknown(next(iter(content)), ['prices'])}")
    if not isinstance(table, dict):
        raise StudyError(f"{path} has no prices; write a table [prices] with {known[0]} = 300e3, for example.")
    for key in table.keys() - {*known}:
        raise StudyError(f"{path}: {toml_file.unknown(key, known)}")
    try:
        return Prices(**table)
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None
