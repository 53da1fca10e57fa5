"""The PMU model: what it says of noise, losses and filters, and that a seed is a seed."""

import numpy as np
import pytest

from stabctl._util.errors import StudyError
from stabctl.estimation.pmu import BadPmu, Instrument, Pmu

ONE = np.ones(1000, complex)


def reports(pmu, seeds=(1,), frames=1, V=ONE):
    instrument = Instrument(pmu, seeds, len(V), 60.0)
    rows = np.tile(V, (len(seeds), 1))
    return [instrument.report(k / pmu.rate, rows, 0.5 * rows, rows.real) for k in range(frames)]


def test_a_seed_gives_the_same_errors_alone_and_among_others():
    pmu = Pmu(loss=0.2, burst=3)
    alone, among = reports(pmu, (7,), 20), reports(pmu, (3, 7, 9), 20)
    for a, b in zip(alone, among, strict=True):
        for name in ("V", "I", "frequency", "rocof", "received"):
            assert (getattr(a, name)[0] == getattr(b, name)[1]).all()
    assert (among[0].V[0] != among[0].V[1]).all()


def test_without_errors_the_report_is_the_truth():
    (frame,) = reports(Pmu.exact())
    assert (frame.V == ONE).all()
    assert (frame.I == 0.5).all()
    assert frame.received.all()


def test_noise_is_as_large_as_it_says_and_within_the_standard():
    pmu = Pmu()
    V = np.concatenate([f.V[0] for f in reports(pmu, frames=50)])
    angle = 2 * np.pi * 60e-6  # of 1 us
    assert np.std(np.abs(V)) == pytest.approx(0.002, rel=0.02)
    assert np.std(np.angle(V)) == pytest.approx(np.hypot(0.002, angle), rel=0.02)
    assert pmu.tve < 0.01 / 3  # the standard's 1 % at three standard deviations: 0.0028
    frequency = np.concatenate([f.frequency[0] for f in reports(pmu, frames=50)])
    assert np.std(frequency) * 60e3 == pytest.approx(5, rel=0.02)


@pytest.mark.parametrize(("loss", "burst"), [(0.1, 1.0), (0.9, 1.0), (0.1, 4.0), (0.8, 4.0)])
def test_losses_have_their_share_and_length(loss, burst):
    lost = ~np.array([f.received[0] for f in reports(Pmu(loss=loss, burst=burst), frames=400)])
    begins = lost[1:] & ~lost[:-1]
    assert lost[50:].mean() == pytest.approx(loss, rel=0.03)
    assert lost[1:].sum() / begins.sum() == pytest.approx(burst if burst > 1 else 1 / (1 - loss), rel=0.03)


def test_an_outage_loses_every_report():
    got = [f.received.all() for f in reports(Pmu(loss=0.0, outage=("50ms", 0.15)), frames=12)]
    assert [k for k, all_there in enumerate(got) if not all_there] == [3, 4, 5, 6, 7, 8]


def test_a_moving_voltage_has_its_frequency():
    pmu = Pmu.exact()
    instrument = Instrument(pmu, (1,), 1, 60.0)
    for k in range(10):
        V = np.exp(2j * np.pi * 0.5 * k / 60).reshape(1, 1)  # 0.5 Hz above nominal
        frame = instrument.report(k / 60, V, V, V.real)
    assert frame.frequency[0, 0] * 60 == pytest.approx(0.5)
    assert frame.rocof[0, 0] == pytest.approx(0, abs=1e-12)


def test_a_class_delays_by_half_its_window_and_keeps_a_steady_turn():
    pmu = Pmu.exact(filter_class="M")
    instrument, frames = Instrument(pmu, (1,), 1, 60.0), []
    for k in range(20):
        V = np.exp(1j * 0.01 * k).reshape(1, 1)
        frames.append(instrument.report(k / 60, V, V, V.real))
    assert (pmu.own_frames(60), pmu.remote_frames(60)) == (3, 3)
    assert np.angle(frames[-1].V[0, 0]) == pytest.approx(0.01 * (19 - 3))


def test_one_machine_or_bad_pmu_is_enough_and_a_whole_rate_may_be_a_float():
    bad = BadPmu(3, "0.5s", jump="5deg")
    assert Pmu(60.0, missing=3, bad=bad) == Pmu(60, missing=(3,), bad=(bad,))
    assert isinstance(Pmu(60.0).rate, int)


@pytest.mark.parametrize("wrong", [{"missing": (3.5,)}, {"missing": 3.5}, {"bad": 3}, {"bad": (3,)}])
def test_what_is_no_machine_or_bad_pmu_is_refused(wrong):
    (name,) = wrong
    with pytest.raises(StudyError, match=rf"^{name} = .* is not allowed; give {name}="):
        Pmu(**wrong)


def test_frames_of_delay():
    assert Pmu(latency=0.05).remote_frames(60) == 3
    assert Pmu(latency="51ms").remote_frames(60) == 4
    assert Pmu(rate=120, latency=0.05, filter_class="P").remote_frames(60) == 2 + 6


@pytest.mark.parametrize(
    "wrong",
    [
        {"rate": 61},
        {"angle": -1},
        {"angle": 1e300},
        {"latency": float("nan")},
        {"latency": 1e300},
        {"loss": 1.0},
        {"burst": 0.5},
        {"loss": 0.801, "burst": 4.0},
        {"outage": ("1s",)},
        {"outage": "1s"},
        {"outage": ("0.8s", "0.6s")},
    ],
)
def test_mistakes_are_sentences(wrong):
    with pytest.raises(StudyError, match=r"must be|choose one of|give "):
        Pmu(**wrong)


@pytest.mark.parametrize(("kind", "rate", "hz"), [("P", 30, 60.0), ("P", 25, 50.0), ("M", 10, 60.0)])
def test_too_few_reports_for_the_window_of_a_filter_are_told(kind, rate, hz):
    with pytest.raises(StudyError, match=f"{rate} reports per second are too few"):
        Pmu(rate, filter_class=kind).own_frames(hz)
    assert Pmu(2 * rate, filter_class=kind).own_frames(hz) == 1
