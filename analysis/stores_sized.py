"""A supercapacitor and a flywheel sized against a battery, for a fault of the two-area system."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import stabctl as st
from reproduction.study import Kept, Study, Table, Tell, present

CASE = "two_area"
FAULT = st.Contingency("7", trip="7-8")
RATINGS = ("50MW", "100MW")
STORES: Mapping[str, dict[str, Any]] = {
    "battery": {"storage_model": "ideal"},
    "supercapacitor": {"storage_model": "supercap"},
    "supercapacitor, Icmax = 1.2": {"storage_model": "supercap", "converter": "Icmax=1.2"},
    "flywheel": {"storage_model": "flywheel"},
    "flywheel, torque = 1.2": {"storage_model": "flywheel", "converter": "torque=1.2"},
}
INSTALLED = {"battery": 1.0, "supercapacitor": 1 / 0.75, "flywheel": 1 / 0.75}  # over usable: 1/(1 - 0.5^2)
STEP = 1.05  # between sizes of the energy
MWS = 3600.0  # per MWh
HEAD = (
    "power per machine", "store", "clearing time with much energy (cycles)", "least usable energy (MW s)",
    "seconds of full power", "energy over that of the battery", "installed energy (MW s)", "lowest charge (%)",
)  # fmt: skip
TEXT = (
    "Devices of the same power at every machine of the two-area system, with the paper's bang-bang law, half charged. "
    "For each store: the critical clearing time of a fault at bus 7 that opens a line 7-8 when energy is no limit, and "
    f"the least usable energy, in steps of {STEP - 1:.0%}, with which it is still reached.",
    "A supercapacitor down to half its voltage and a flywheel down to half its speed use three quarters of the energy "
    "that is installed. Icmax and torque are in rated power over full voltage or speed: with 2 they give full power "
    "almost to the end, with 1.2 it falls with voltage or speed. The station supplies the losses of a flywheel at "
    "its initial speed, and goes on when it has slowed down. Each MW s that it gains so saves two, as half of the "
    "energy is there at first.",
)


def study(reports: Path) -> Study:
    """The least energy of each store."""
    kept = Kept(__file__, reports)
    rows = []
    for rating in RATINGS:
        found = {name: kept(f"{rating}, {name}", partial(_sized, rating, name)) for name in STORES}
        for name, one in found.items():
            energy, kind = one["energy"], name.partition(",")[0]
            over = energy / found["battery"]["energy"]
            numbers = one["cycles"], energy, energy / one["mw"], over, energy * INSTALLED[kind], one["charge"]
            formats = "{:.3f}", "{:.1f}", "{:.2f}", "{:.2f}", "{:.1f}", "{:.0f}"
            rows.append((rating, name, *(f.format(x) for f, x in zip(formats, numbers, strict=True))))
    return Study("Stores of energy", text=TEXT, tables=(Table("The least energy of each store", HEAD, tuple(rows)),))


def _sized(rating: str, name: str, tell: Tell) -> dict[str, float]:
    """Clearing time with much energy, and the least energy per device (MW s) that reaches it."""
    mw = float(rating.removesuffix("MW"))

    def fleet(energy: float) -> st.OperatingPoint:
        return st.load(CASE).with_storage(rating, energy=energy / MWS, **STORES[name]).initialize()

    def cycles(energy: float) -> float:
        found = fleet(energy).clearing_time(FAULT, control=st.BangBang()).cycles
        tell(f"{energy:.1f} MW s: {found:g} cycles")
        return found

    most = cycles(20 * mw)
    low, high = 0.02 * mw, 20 * mw
    while high > STEP * low:
        middle = (low * high) ** 0.5
        low, high = (low, middle) if cycles(middle) >= most else (middle, high)
    cleared = st.Contingency("7", trip="7-8", clear=f"{most}cyc")
    run = fleet(high).simulate(cleared, control=st.BangBang())
    least = float(run.dataset.storage_energy.min())  # MWh
    return {"cycles": most, "energy": high, "mw": mw, "charge": 100 * MWS * least / high}


if __name__ == "__main__":
    present(study)
