"""Combinations of parameters that a model refuses, each beside the nearest one that it takes."""

import pytest
from library import EXCITERS, POINTS, STABILIZERS
from records import pidgov, wpidhy
from systems import CLASSICAL, EXDC2, EXST3, GOVERNORS, IEEET1, POLES, REGC, ROUND, SATURATED, TWO_AXES, TYPE_J

from stabctl.devices.blocks import SHORT

REFUSED = [  # parameters, changes that are refused, the field named, further changes with which they are taken
    (ROUND, {"x1d": ROUND.xl}, "x1d", {"x1d": 0.151, "T2d": 0.03}),
    (ROUND, {"x1q": ROUND.xl}, "x1q", {"x1q": 0.151}),
    (ROUND, {"T2d": 0.0}, "T2d", {"x1d": ROUND.x2}),
    (ROUND, {"T2q": 0.0}, "T2q", {"x1q": ROUND.x2}),
    (SATURATED, {"S12": SATURATED.S10}, "S12", {"S12": 0.11}),
    (SATURATED, {"S12": 0.05}, "S12", {"S12": 0.0}),
    (POLES, {"x1d": POLES.xl}, "x1d", {"x1d": 0.151}),
    (POLES, {"S12": 0.05}, "S12", {"S10": 0.04}),
    (POLES, {"T2d": 0.0}, "T2d", {"x1d": POLES.x2}),
    (POLES, {"T2q": 0.0}, "T2q", {"xq": POLES.x2}),
    (TYPE_J, {"x1d": TYPE_J.x2d}, "x1d", {"x1d": 0.23}),
    (TYPE_J, {"x1q": TYPE_J.x2q}, "x1q", {"x1q": 0.26}),
    (TYPE_J, {"S12": 0.05}, "S12", {"S12": 0.0}),
    (TYPE_J, {"T1q": 0.0}, "T1q", {"x1q": TYPE_J.xq}),
    (ROUND, {"T1q": 0.0}, "T1q", {"x1q": ROUND.xq}),
    (SATURATED, {"T1q": 0.0, "x1q": SATURATED.xq}, "T1q", {"S10": 0.0}),
    (TWO_AXES, {"T1q": 0.0}, "T1q", {"x1q": TWO_AXES.xq}),
    (CLASSICAL, {"H": 0.0099}, "H", {"H": 0.01}),
    (CLASSICAL, {"H": 1e-9}, "H", {"H": 0.0}),
    (EXST3, {"KG": 0.1, "TA": SHORT / 2}, "TA", {"TA": SHORT}),
    (EXST3, {"KG": 0.1, "TA": 0.0}, "TA", {"KG": 0.0}),
    (EXCITERS["st8c"], {"KPR": 0.0, "KIR": 0.0}, "KPR", {"KIR": 0.1}),
    (EXCITERS["st8c"], {"KPA": 0.0, "KIA": 0.0}, "KPA", {"KPA": 0.1}),
    (EXCITERS["dc4b"], {"KP": 0.0, "KI": 0.0}, "KP", {"KI": 0.1}),
    (EXCITERS["dc4b"], {"KI": 0.0, "KP": 0.0}, "KP", {"KP": 0.1}),
    (EXCITERS["esst4b"], {"KPR": 0.0, "KIR": 0.0}, "KPR", {"KIR": 0.1}),
    (EXCITERS["esst4b"], {"KPM": 0.0, "KIM": 0.0}, "KPM", {"KPM": 0.1}),
    (EXCITERS["st6b"], {"KPA": 0.0, "KIA": 0.0}, "KPA", {"KIA": 0.1}),
    (EXCITERS["st6b"], {"KFF": 0.0, "KM": 0.0}, "KM", {"KFF": 0.1}),
    (EXCITERS["exst1"], {"KF": 0.01, "TF": SHORT, "TA": SHORT / 2}, "TA", {"TA": SHORT}),
    (EXCITERS["exst1"], {"KF": 0.01, "TF": SHORT, "TA": 0.0}, "TA", {"TF": SHORT / 2}),
    (EXCITERS["esst1a"], {"KF": 0.01, "TF": SHORT, "TA": SHORT / 2}, "TA", {"TA": SHORT}),
    (EXCITERS["esst1a"], {"KF": 0.01, "TF": SHORT, "TA": 0.0}, "TA", {"KF": 0.0}),
    (EXCITERS["ieeet2"], {"KF": 0.01, "TA": SHORT / 2}, "TA", {"TA": SHORT}),
    (EXCITERS["esst3a"], {"KG": 0.5, "TM": SHORT / 2}, "TM", {"TM": SHORT}),
    (EXCITERS["expic1, static"], {"KF": 0.1, "TF1": SHORT, "TE": 0.0, "TF2": 0.0}, "TF2", {"TF2": SHORT}),
    (EXCITERS["expic1, static"], {"KF": 0.1, "TF1": SHORT, "TE": 0.0, "TF2": 0.0}, "TF2", {"TE": SHORT}),
    (STABILIZERS["pss2b"], {"M": 3, "N": 3}, "M", {"M": 2, "N": 4}),
    (REGC, {"Zerox": 0.9, "Brkpt": 0.9}, "Brkpt", {"Zerox": 0.89}),
    (REGC, {"Lvpnt0": 0.8, "Lvpnt1": 0.8}, "Lvpnt1", {"Lvpnt1": 0.81}),
    (GOVERNORS[pidgov], {"G1": 0.75}, "G2", {"G2": 0.76}),
    (GOVERNORS[wpidhy], {"G1": 0.75}, "G2", {"G2": 0.76}),
    (GOVERNORS[pidgov], {"G2": 1.0}, "G2", {"G2": 0.99}),
    (GOVERNORS[pidgov], {"G1": 0.0, "G0": 0.0}, "G1", {"G1": 0.1}),
    (GOVERNORS[pidgov], {"P1": 0.0}, "P1", {"P1": 0.1}),
    (GOVERNORS[pidgov], {"P2": 0.3}, "P2", {"P2": 0.31}),
    (GOVERNORS[pidgov], {"P3": 0.55}, "P3", {"P3": 0.56}),
    *(
        (par, POINTS | changes, "SE2", taken)
        for par in [EXDC2, IEEET1, *(par for par in EXCITERS.values() if "SE2" in par._fields)]
        for changes, taken in (
            ({"E2": POINTS["E1"]}, {"E2": 1.3}),
            ({"SE2": POINTS["SE1"] / 2}, {"SE2": 0.026}),  # SE E is the same in both points
            ({"SE2": 0.01}, {"SE2": 0.0}),
        )
    ),
]


@pytest.mark.parametrize(("par", "changes", "field", "taken"), REFUSED)
def test_a_combination_is_refused_and_the_nearest_possible_one_is_not(par, changes, field, taken):
    wrong = par._replace(**changes)
    assert dict(wrong.errors()).keys() == {field}
    assert not dict(wrong._replace(**taken).errors())
