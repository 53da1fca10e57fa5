"""MVA of storage behind converters against the MW of ideal devices, with the paper's law and with designed ones."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import stabctl as st
from reproduction.study import Kept, Study, Table, Tell, present
from stabctl.placement.contingencies import contingencies, packaged
from stabctl.placement.siting import Siting

FULL = True
CASE = "ieee39"
BESIDE = "5%mva"  # devices that the laws are designed for
MODELS: Mapping[str, dict[str, Any]] = {
    "ideal": {},
    "grid-following": {"storage_model": "regc"},
    "grid-following, MVA for 0.8 pu": {"storage_model": "regc", "mva": "0.8pu"},
    "grid-following with PLL": {"storage_model": "regc_c", "converter": "Te=0"},
    "grid-forming": {"storage_model": "regfm"},
    "grid-forming, ImaxF = 1.11": {"storage_model": "regfm", "converter": "ImaxF=1.11"},
}
SIZES = "storage", "MW", "MVA", "MVA over ideal MW (%)", "kWh", "sites", "at the current limit", "cuts allow (MW)"
GAINS = "storage", "law", "median gain (cycles)", "range", "MW", "MVA", "kWh"
TEXT = (
    "The cheapest fleets found for the packaged contingencies of the 39-bus system with the paper's law: of ideal "
    "devices, and behind converters of as many MVA as MW, or of the MVA with which the current limit allows the rated "
    "power down to 0.8 pu.",
    f"A law is designed for the same contingencies with devices of {BESIDE} of every machine behind each converter, "
    "and a fleet is found with this law. Gains in cycles over the paper's law, in all contingencies.",
)


def study(reports: Path) -> Study:
    """Fleets with the paper's law; then the laws, and fleets with them."""
    kept = Kept(__file__, reports)
    sized = {name: kept(f"{name}, paper's law", partial(_sized, None, options)) for name, options in MODELS.items()}
    least = sized["ideal"]["mw"]
    rows = (
        (name, f"{f['mw']:.0f}", f"{f['mva']:.0f}", f"{100 * f['mva'] / least:.0f}", f"{f['kwh']:.0f}", *_counts(f))
        for name, f in sized.items()
    )
    designed = (_designed(name, options, kept) for name, options in MODELS.items())
    tables = (
        Table("Fleets with the paper's law", SIZES, tuple(rows)),
        Table("Designed laws, and fleets with them", GAINS, tuple(designed)),
    )
    return Study("MVA of storage behind converters", text=TEXT, tables=tables)


def _sized(law: Any, options: dict[str, Any], tell: Tell) -> dict[str, Any]:
    """The fleet found with a law, by default the paper's."""
    case = st.load(CASE)
    found = st.place(case, _wanted(case), control=law, device=options, progress=lambda runs, cost: tell(f"{runs} runs"))
    return _summary(found)


def _wanted(case: st.Case) -> Any:
    return contingencies(case, packaged(CASE, classical=False))


def _summary(found: Siting) -> dict[str, Any]:
    limited = sum(s.limited for s in found.sites)
    return {
        "mw": found.total_mw,
        "mva": found.total_mva,
        "kwh": 1e3 * found.total_mwh,
        "sites": len(found.sites),
        "limited": limited if found.converters else None,
        "bound": found.cuts_mw,
    }


def _counts(fleet: dict[str, Any]) -> tuple[str, str, str]:
    limited, bound = fleet["limited"], fleet["bound"]
    return str(fleet["sites"]), "" if limited is None else str(limited), "" if bound is None else f"{bound:.0f}"


def _designed(name: str, options: dict[str, Any], kept: Kept) -> tuple[str, ...]:
    """A law for devices behind a converter, and a fleet with it."""
    case = st.load(CASE).with_storage(BESIDE, **options)
    found = st.design.law(case, _wanted(case), training=1.0, store=kept.folder)
    fleet = kept(f"{name}, designed law", partial(_sized, found.law, options))
    gain, law = found.gain, ", ".join(f"{p.name} {p.value}" for p in found.parameters)
    sizes = f"{fleet['mw']:.0f}", f"{fleet['mva']:.0f}", f"{fleet['kwh']:.0f}"
    return name, law, f"{gain.median:+g}", f"{gain.least:+g} to {gain.most:+g}", *sizes


if __name__ == "__main__":
    present(study)
