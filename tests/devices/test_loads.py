"""Load models: powers of voltage and frequency."""

import numpy as np
import pytest

from stabctl.devices.loads import ieel, zip_load

LOAD = ieel.Par(2.0, 0.8, 1.03, 0.5, 377.0, 0.4, 0.2, 0.4, 0.5, 0.25, 0.25, 2.0, -1.5, 1.8, 1.0, 0.0, 2.0, 1.0, 0.0)


def drawn(par, v, df=0.0):
    """Complex power drawn at a voltage phasor."""
    re, im = ieel.current(ieel.State(0.0, df), (v.real, v.imag), par)
    return -v * np.conj(complex(re, im))


def test_it_draws_its_power_at_the_voltage_of_the_power_flow():
    assert drawn(LOAD, 1.03 * np.exp(0.3j)) == pytest.approx(2.0 + 0.8j, abs=1e-12)


@pytest.mark.parametrize("v", [0.7, 0.9, 1.1])
def test_power_over_voltage_and_frequency(v):
    def share(a, n, V):
        return sum(x * V**y for x, y in zip(a, n, strict=True))

    P = 2.0 * share((0.4, 0.2, 0.4), (1.8, 1, 0), v) / share((0.4, 0.2, 0.4), (1.8, 1, 0), 1.03)
    Q = 0.8 * share((0.5, 0.25, 0.25), (2, 1, 0), v) / share((0.5, 0.25, 0.25), (2, 1, 0), 1.03)
    assert drawn(LOAD, v * np.exp(-1j), df=0.01) == pytest.approx(P * 1.02 + 1j * Q * 0.985, abs=1e-12)


def test_powers_0_1_and_2_are_the_load_of_three_parts():
    par = LOAD._replace(a1=0.5, a2=0.3, a3=0.2, n1=2.0, n2=1.0, n3=0.0, V0=1.0, a7=0.0, a8=0.0)
    parts = zip_load.Par(0.4, 0.2, 0.6, 0.2, 1.0, 0.4, 0.5)
    for v in (0.2 + 0.1j, 0.9 - 0.2j, 1.1 + 0j):
        assert ieel.current(ieel.State(0.0, 0.0), (v.real, v.imag), par) == pytest.approx(
            zip_load.current((v.real, v.imag), parts), abs=1e-12
        )


def test_a_voltage_that_turns_faster_raises_the_frequency_by_as_much():
    """Turning 0.01 pu faster than the tracked angle, which it leads by 0.01 wb T at rest."""
    lead = 0.01 * 377.0 * ieel.T
    rates = ieel.derivatives(ieel.State(0.0, 0.01), (np.cos(lead), np.sin(lead)), LOAD)
    assert rates == pytest.approx((0.01 * 377.0, 0.0), abs=1e-12)
    still = ieel.derivatives(ieel.State(0.0, 0.0), (0.0, 1.0), LOAD._replace(a7=0.0, a8=0.0))
    assert still == (0.0, 0.0)


def test_a_record_without_shares_is_refused():
    names = "a1 a2 a3 a4 a5 a6".split()  # noqa: SIM905
    with pytest.raises(ValueError, match="a4"):
        ieel.from_record("IEELBL", dict.fromkeys(names, 0.0) | {"a1": 1.0})
