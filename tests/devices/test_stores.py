"""Stores of energy: what they lose and how far they go, and with a fast converter they are as the ideal device."""

import numpy as np
import pytest
from stored import driven, signal, with_esd
from systems import one_of

from stabctl import devices
from stabctl._util.errors import StabctlError
from stabctl.devices.storage import MODELS, STORES
from stabctl.dynamics import operating_point, storage
from stabctl.simulation.stages import stages

FULL = 0.02 * 3600 / 100  # pu s   of 0.02 MWh
CYCLE = {0.2: 1.0, 0.8: -1.0, 1.5: 0.3}
SUPERCAP = "Rs=0.1 Icmax=2.4 Vcmin=0.6"
FLYWHEEL = "wlow=0.4 friction=0.05 windage=0.1"
TEXT = {"supercap": SUPERCAP, "flywheel": FLYWHEEL}
LOSSY = [f"{store}{behind}" for store in TEXT for behind in ("", "_regc_b", "_regfm")]


def stored(model, **options):
    """The small system with 40 MW and 0.02 MWh, 50 MVA behind a converter."""
    given = {"energy": 0.02, "mva": 0.0 if model in ("ideal", *STORES) else 50.0, "storage_model": model}
    return with_esd(**given | options)


def test_a_store_of_constant_voltage_is_the_battery_to_the_last_bit():
    """Without resistance and with a voltage that does not fall: the same states, outputs and currents."""
    orders = {0.1: 1.0, 0.9: -1.0}
    runs = [
        driven(stored(model, efficiency=0.81, lag=0.05, converter=text), orders)
        for model, text in (("ideal", ""), ("supercap", "Vcmin=1 Rs=0"), ("flywheel", "wlow=1 friction=0 windage=0"))
    ]
    for run in runs[1:]:
        assert run.rows.tobytes() == runs[0].rows.tobytes()
    assert np.ptp(signal(runs[0], "energy")) > 0.2


def lost(model, P, energy):
    """Losses (pu) at a power into the store and an energy, of other formulas than those of the file; rating 0.4 pu."""
    share = P / 0.4
    if model.startswith("supercap"):
        v = np.sqrt(0.6**2 + (1 - 0.6**2) * energy / FULL)
        i = (np.sqrt(v**2 + 4 * 0.1 * share) - v) / (2 * 0.1)
        return 0.4 * 0.1 * i**2
    w = np.sqrt(0.4**2 + (1 - 0.4**2) * np.array([energy, np.full_like(energy, FULL / 2)]) / FULL)
    now, before = 0.05 * w + 0.1 * w**3
    return 0.4 * (now - before)


@pytest.mark.parametrize("efficiency", [1.0, 0.81])
@pytest.mark.parametrize("model", one_of("supercap", "flywheel", *(m for m in LOSSY if "_" in m)))
def test_energy_is_what_came_in_less_the_losses(model, efficiency):
    """Over a cycle: the power at the terminals against the energy, summed over the stages of all Runge-Kutta steps."""
    run = driven(stored(model, efficiency=efficiency, converter=TEXT[model.split("_")[0]]), CYCLE, until=2.0)
    at, lay = storage.places(run.point.system, run.point.case), run.point.layout
    gained, lossy, way = [0.0], 0.0, np.sqrt(efficiency)
    for part in stages(run):
        P, energy = part.signals[:, :, at.P[0]], part.signals[:, :, at.energy[0]]
        P = np.where(P > 0, way, 1 / way) * P
        losses = lost(model, P, energy)
        weights = np.array([1 / 6, 1 / 3, 1 / 3, 1 / 6])
        gained += (part.sizes * ((P - losses) @ weights)).tolist()
        lossy += float((part.sizes * (np.abs(losses) @ weights)).sum())
    energy = signal(run, "energy")
    assert at.energy[0] < lay.nx
    assert energy - energy[0] == pytest.approx(np.cumsum(gained), abs=1e-8)  # 2e-10 pu s
    assert lossy > 0.002  # pu s; a twentieth of what went through
    assert 0 < energy.min() < energy.max() < FULL  # neither full nor empty, where other laws hold


def test_a_round_trip_of_a_supercapacitor_costs_what_its_resistance_takes():
    """At constant current i the voltage rises and falls by the same, so the loss of a cycle is 2 Rs i^2 t."""
    device = devices.every()["supercap"]
    store = device.module.store
    par = store.Par(inverse=1 / 0.4, Vcmin=0.6, Rs=0.1, Icmax=2.4)
    for v, i in ((0.7, 0.5), (0.9, -1.5), (1.0, 2.0)):
        P = 0.4 * (v + 0.1 * i) * i
        assert store.current(v, P, par) == pytest.approx(0.4 * i, rel=1e-14)


@pytest.mark.parametrize(
    ("model", "text", "most"),
    [
        ("supercap", "Rs=0.05 Icmax=1.2", lambda v: 0.9 * (v - 0.05 * 1.2) * 1.2),
        ("flywheel", "torque=1.1", lambda w: 0.9 * 1.1 * w),
        pytest.param("supercap_regc", "Rs=0.05 Icmax=1.2", lambda v: 0.9 * (v - 0.06) * 1.2, marks=pytest.mark.slow),
    ],
)
def test_its_power_falls_as_it_empties(model, text, most):
    """Ordered to give all it has from a charge of 0.6: as much as current or torque allow, until it is empty."""
    run = driven(stored(model, charge=0.6, efficiency=0.81, converter=text), {0.2: -1.0}, until=1.4)
    given, charge = -run.arrays.storage[:, 0] / 40, signal(run, "charge")
    busy = (run.time > 0.5) & (charge > 0.02)
    wanted = np.minimum(most(np.sqrt(0.25 + 0.75 * charge)), 1.0)  # voltage or speed, half of it where it is empty
    assert given[busy] == pytest.approx(wanted[busy], abs=1e-12 if model in STORES else 0.02)
    assert given[busy].min() < 0.8
    assert charge.min() > -1e-9
    if (empty := charge < 1e-12).any():
        assert np.abs(given[empty][2:]).max() < 1e-9


def energies(run):
    """Energy (pu s) of the device at every instant."""
    return signal(run, "energy")


FOLLOWING = "Tg={T} Trv={T} Tpord={T} Tiq={T} Tfltr={T} Rrpwr=1e4 dPmax=1e4 dPmin=-1e4 Imax=9"
FORMING = "mp={slope} mq={drop} TQf={quarter} TVf={quarter} kpv=0 kiv=6 ImaxF=9"
FAST = {  # free of limits, and as fast as the lags T; forming: droops so steep that P and Q follow their references
    "regc": f"{FOLLOWING} Lvplsw=0 Lvpnt1=0.02 Lvpnt0=0.01",
    "regc_b": f"{FOLLOWING} Te=0",
    "regc_c": f"{FOLLOWING} Te=0 Kip=1 Kii={{twice}} Kppll={{rate}} Kipll={{fifth}} wmax=1e4 wmin=-1e4",
    "regfm": f"{FORMING} TPf={{quarter}} Emax=9 Pmax=9 Pmin=-9 Qmax=9 Qmin=-9",
    "regfm_b1": f"{FORMING} TPf=0 H={{inertia}} D2=0 TIf={{quarter}} ImaxSS=9 dwmax=9 dwmin=-9",
}
FAST |= {f"{name}_repc": f"{text} repc_FFlag=0" for name, text in FAST.items() if "regc" in name}


def with_lags(behind, T):
    """Parameters of a converter whose slowest response takes T (s); the rate of P over the angle is about 5 pu/rad."""
    slope = 1 / (377 * 5 * T)  # mp, so that wb mp dP/ddelta = 1/T
    return FAST[behind].format(
        T=T, quarter=T / 4, twice=2 / T, rate=1 / T, fifth=0.2 / T, slope=slope, drop=0.03 / T, inertia=T / 8 / slope
    )


@pytest.mark.parametrize("model", one_of("regc", *(m for m in MODELS if m not in ("ideal", *STORES))))
def test_with_fast_lags_and_much_current_it_tends_to_its_ideal_store(model):
    """Its distance in power and in energy halves with the lags; no low-voltage logic, as the ideal device has none."""
    prefix = next((store for store in TEXT if model.startswith(store)), "")
    behind, orders = model.removeprefix(f"{prefix}_"), {0.2: 1.0, 0.7: -1.0}
    own = f"{TEXT.get(prefix, '')} "
    ideal = driven(stored(prefix or "ideal", converter=own.strip()), orders, until=1.2, step=1 / 1200)
    weights = np.where(np.isin(np.round(ideal.time, 9), list(orders)), 0.5, 1.0)  # an integral from jump to jump
    far = []
    for T in (0.016, 0.008, 0.004):
        run = driven(stored(model, converter=own + with_lags(behind, T)), orders, until=1.2, step=1 / 1200)
        power, energy = (np.abs(of(run) - of(ideal)) for of in (lambda r: r.arrays.storage[:, 0], energies))
        far.append((np.average(power, weights=weights), energy.mean()))
        speeds = np.abs(run.arrays.speed - ideal.arrays.speed).max()
    assert np.divide(far[:-1], far[1:]) == pytest.approx(2, rel=0.04)  # 1.927 to 2.000
    assert speeds < 5e-5  # 4.7e-5 pu with lags of 4 ms, of a swing of 5e-4


def test_at_its_start_nothing_moves_though_a_flywheel_loses():
    point = operating_point.solve(stored("flywheel", converter=FLYWHEEL))
    assert np.abs(point.equations.at(point.s.copy()).rates).max() < 1e-9


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"energy": 0.0},
            "power of a supercap depends on its stored energy, which must be limited; give its capacity: energy=",
        ),
        ({"converter": "Rs=0.5"}, "Icmax = 2 must be at most Vcmin/(2 Rs) = 0.5, the current of most power"),
        ({"converter": "Vcmin=1.2"}, "Vcmin = 1.2 must be a number above 0 and of at most 1"),
        ({"converter": "R=0.1"}, "There is no parameter 'R' of SUPERCAP; choose one of Rs"),
        ({"storage_model": "supercaps"}, "'supercaps' is not allowed; it must be one of ideal, regc, "),
    ],
)
def test_what_a_store_cannot_be_is_refused(options, message):
    with pytest.raises(StabctlError) as error:
        stored("supercap", **options)
    assert message in str(error.value)
