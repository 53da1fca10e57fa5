"""One row of parameters of every exciter and stabilizer of the library, and more where it has more branches."""

from records import (
    dc4b,
    esac1a,
    esac6a,
    esdc1a,
    esdc2a,
    esst1a,
    esst3a,
    esst4b,
    exac1,
    exac2,
    expic1,
    exst1,
    exst3,
    ieeest,
    ieeet2,
    ieeex1,
    pss2b,
    scrx,
    st2cut,
    st6b,
    st8c,
    stab2a,
)

POINTS = {"E1": 1.2, "SE1": 0.05, "E2": 2.4, "SE2": 0.3}  # of saturation
DC = (0.02, 40.0, 0.05, 1.0, 0.5, 6.0, -6.0, 1.0, 0.5, 0.05)  # TR KA TA TB TC VRmax VRmin KE TE KF
ALTERNATOR = {"TE": 0.6, "KC": 0.1, "KD": 0.3, "KE": 1.0} | POINTS
AMPLIFIER = {"TR": 0.02, "KA": 60.0, "TA": 0.05, "TB": 1.0, "TC": 0.5}
COMPOUND = {"KP": 3.0, "KI": 0.8, "XL": 0.1, "KC": 0.1, "THETAP": 20.0}
STATIC = {"TR": 0.02, "VImax": 0.3, "VImin": -0.3, "VRmax": 8.0, "VRmin": -8.0}
EXCITERS = {  # name -> exciter
    "scrx": scrx.Par(20.0, 0.05, 5.0, 1.0, switch=0, resistor=1.0),
    "scrx with a constant source": scrx.Par(20.0, 0.0, 0.0, 0.0, switch=1),
    "exst1": exst1.Par(**STATIC, TC=0.5, TB=1.0, KA=80.0, TA=0.05, KC=0.1, KF=0.01),
    "ieeet2": ieeet2.Par(0.02, 40.0, 0.05, 6.0, -6.0, 1.0, 0.5, 0.05, 1.0, 0.2, **POINTS),
    "ieeex1": ieeex1.Par(*DC, **POINTS),
    "ieeex1, KE computed": ieeex1.Par(*DC, **POINTS)._replace(KE=0.0),
    "esdc1a": esdc1a.Par(*DC, **POINTS),
    "esdc2a": esdc2a.Par(*DC, **POINTS),
    "dc4b": dc4b.Par(0.02, 8.0, 4.0, 0.2, 0.1, 6.0, -6.0, 1.0, 0.05, 1.0, 0.5, 0.02, 1.0, **POINTS),
    "exac1": exac1.Par(**AMPLIFIER, **ALTERNATOR, VRmax=9.0, VRmin=-9.0, KF=0.03, TF=1.0),
    "esac1a": esac1a.Par(**AMPLIFIER, **ALTERNATOR, VAmax=9.0, VAmin=-9.0, VRmax=8.0, VRmin=-8.0, KF=0.03, TF=1.0),
    "exac2": exac2.Par(
        **AMPLIFIER, **ALTERNATOR, VAmax=20.0, VAmin=-20.0, VRmax=50.0, VRmin=-50.0, KF=0.03, TF=1.0, KB=5.0, KL=10.0,
        KH=0.5, VLR=20.0,
    ),
    "esac6a": esac6a.Par(
        **AMPLIFIER, **ALTERNATOR, TK=0.02, VAmax=20.0, VAmin=-20.0, VRmax=15.0, VRmin=-15.0, VFELIM=0.5, KH=0.1,
        VHmax=5.0, TH=0.1, TJ=0.05,
    ),
    "esst1a": esst1a.Par(
        **STATIC, TC=0.5, TB=1.0, TC1=0.1, TB1=0.05, KA=80.0, TA=0.05, VAmax=9.0, VAmin=-9.0, KC=0.1, KF=0.01, KLR=0.1,
        ILR=0.5,
    ),
    "esst3a": esst3a.Par(
        **STATIC, **COMPOUND, KM=5.0, TC=0.5, TB=1.0, KA=20.0, TA=0.05, KG=0.5, VBmax=9.0, VGmax=6.0, TM=0.1, VMmax=8.0,
        VMmin=-8.0,
    ),
    "esst4b": esst4b.Par(
        TR=0.02, **COMPOUND, KPR=4.0, KIR=3.0, VRmax=8.0, VRmin=-8.0, TA=0.05, KPM=0.5, KIM=2.0, VMmax=8.0, VMmin=-8.0,
        KG=0.2, VBmax=9.0,
    ),
    "esst4b without integrals": esst4b.Par(
        TR=0.0, **COMPOUND, KPR=20.0, KIR=0.0, VRmax=8.0, VRmin=-8.0, TA=0.05, KPM=1.0, KIM=0.0, VMmax=8.0, VMmin=-8.0,
        KG=0.0, VBmax=9.0,
    ),
    "exst3 with a compound source": exst3.Par(**STATIC, **COMPOUND, KA=20.0, TA=0.1, TB=1.0, TC=0.5, KG=0.1),
    "expic1": expic1.Par(
        0.02, 5.0, 1.0, 8.0, -8.0, 0.1, 0.2, 0.05, 8.0, -8.0, 0.03, 1.0, 0.3, 8.0, -8.0, 1.0, 0.5, **POINTS, KP=1.5,
        KI=0.5, KC=0.1,
    ),
    "expic1, static": expic1.Par(
        0.0, 5.0, 1.0, 8.0, -8.0, 0.0, 0.2, 0.05, 8.0, -8.0, 0.03, 1.0, 0.3, 8.0, -8.0, 1.0, 0.0
    ),
    "st6b": st6b.Par(0.02, 9.0, 5.0, 0.1, 0.05, 8.0, -8.0, 1.0, 1.0, 1.05, 17.0, 5.0, 8.0, -8.0, 1.0, 0.05),
    "st8c": st8c.Par(
        0.02, 5.0, 3.0, 20.0, 0.0, 4.0, 2.0, 20.0, -20.0, 1.0, 0.05, 20.0, -20.0, 0.5, 0.02, 0.1, 4.0, KI2=0.5, KC2=0.05
    ),
    "st8c fed by the terminals": st8c.Par(
        0.02, 5.0, 3.0, 20.0, 0.0, 4.0, 2.0, 20.0, -20.0, 1.0, 0.05, 20.0, -20.0, 0.5, 0.02, 0.1, 4.0, 0.5, 0.1, 20.0,
        SW1=1,
    ),
}  # fmt: skip
STABILIZERS = {  # name -> stabilizer
    "ieeest": ieeest.Par(0.06, 0.002, 0.05, 0.001, 0.05, 0.001, 0.1, 0.05, 0.1, 0.05, 2.0, 2.0, 3.0, VCU=1.4, VCL=0.2),
    "ieeest of power, first order": ieeest.Par(
        0.06, 0.0, 0.0, 0.0, 0.03, 0.0, 0.1, 0.05, 0.1, 0.05, 2.0, 2.0, -0.1, code=3
    ),
    "st2cut": st2cut.Par(
        3.0, -0.1, 0.02, 0.03, 2.0, 2.0, 0.1, 0.05, 0.1, 0.05, 0.06, 0.04, VCU=0.6, VCL=-0.6, code1=1, code2=3
    ),
    "stab2a": stab2a.Par(1.0, 1.0, 0.3, 0.5, 0.05, 0.8, 0.05),
    "pss2b": pss2b.Par(
        2.0, 2.0, 0.02, 2.0, 0.0, 2.0, 0.25, 1.0, 0.3, 0.1, 5.0, 0.15, 0.05, 0.15, 0.05, 0.02, 0.01, code2=3
    ),
}  # fmt: skip
