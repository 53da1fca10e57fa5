"""One row of parameters of every exciter and stabilizer of the library, and more where it has more branches."""

from records import (
    ac8b,
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
    "scrx": scrx.Par(K=20.0, TE=0.05, TB=5.0, TC=1.0, switch=0, resistor=1.0),
    "scrx with a constant source": scrx.Par(K=20.0, TE=0.0, TB=0.0, TC=0.0, switch=1),
    "exst1": exst1.Par(**STATIC, TC=0.5, TB=1.0, KA=80.0, TA=0.05, KC=0.1, KF=0.01),
    "ieeet2": ieeet2.Par(
        TR=0.02, KA=40.0, TA=0.05, VRmax=6.0, VRmin=-6.0, KE=1.0, TE=0.5, KF=0.05, TF1=1.0, TF2=0.2, **POINTS,
    ),
    "ieeex1": ieeex1.Par(*DC, **POINTS),
    "ieeex1, KE computed": ieeex1.Par(*DC, **POINTS)._replace(KE=0.0),
    "esdc1a": esdc1a.Par(*DC, **POINTS),
    "esdc2a": esdc2a.Par(*DC, **POINTS),
    "dc4b": dc4b.Par(
        TR=0.02, KP=8.0, KI=4.0, KD=0.2, TD=0.1, VRmax=6.0, VRmin=-6.0, KA=1.0, TA=0.05, KE=1.0, TE=0.5, KF=0.02,
        TF=1.0, **POINTS,
    ),
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
    "ac8b": ac8b.Par(
        TR=0.02, KPR=8.0, KIR=5.0, KDR=0.5, TDR=0.1, VPIDmax=35.0, VPIDmin=-5.0, KA=1.0, TA=0.02, VRmax=35.0, VRmin=0.0,
        VFEmax=12.0, VEmin=0.0, **ALTERNATOR,
    ),
    "esst1a": esst1a.Par(
        **STATIC, TC=0.5, TB=1.0, TC1=0.1, TB1=0.05, KA=80.0, TA=0.05, VAmax=9.0, VAmin=-9.0, KC=0.1, KF=0.01,
        KLR=0.1, ILR=0.5,
    ),
    "esst3a": esst3a.Par(
        **STATIC, **COMPOUND, KM=5.0, TC=0.5, TB=1.0, KA=20.0, TA=0.05, KG=0.5, VBmax=9.0, VGmax=6.0, TM=0.1,
        VMmax=8.0, VMmin=-8.0,
    ),
    "esst4b": esst4b.Par(
        TR=0.02, **COMPOUND, KPR=4.0, KIR=3.0, VRmax=8.0, VRmin=-8.0, TA=0.05, KPM=0.5, KIM=2.0, VMmax=8.0,
        VMmin=-8.0, KG=0.2, VBmax=9.0,
    ),
    "esst4b without integrals": esst4b.Par(
        TR=0.0, **COMPOUND, KPR=20.0, KIR=0.0, VRmax=8.0, VRmin=-8.0, TA=0.05, KPM=1.0, KIM=0.0, VMmax=8.0,
        VMmin=-8.0, KG=0.0, VBmax=9.0,
    ),
    "exst3 with a compound source": exst3.Par(**STATIC, **COMPOUND, KA=20.0, TA=0.1, TB=1.0, TC=0.5, KG=0.1),
    "expic1": expic1.Par(
        TR=0.02, KA=5.0, TA1=1.0, VAmax=8.0, VAmin=-8.0, TA2=0.1, TA3=0.2, TA4=0.05, VRmax=8.0, VRmin=-8.0, KF=0.03,
        TF1=1.0, TF2=0.3, Efdmax=8.0, Efdmin=-8.0, KE=1.0, TE=0.5, **POINTS, KP=1.5, KI=0.5, KC=0.1,
    ),
    "expic1, static": expic1.Par(
        TR=0.0, KA=5.0, TA1=1.0, VAmax=8.0, VAmin=-8.0, TA2=0.0, TA3=0.2, TA4=0.05, VRmax=8.0, VRmin=-8.0, KF=0.03,
        TF1=1.0, TF2=0.3, Efdmax=8.0, Efdmin=-8.0, KE=1.0, TE=0.0,
    ),
    "st6b": st6b.Par(
        TR=0.02, KPA=9.0, KIA=5.0, KDA=0.1, TDA=0.05, VAmax=8.0, VAmin=-8.0, KFF=1.0, KM=1.0, KCI=1.05, KLR=17.0,
        ILR=5.0, VRmax=8.0, VRmin=-8.0, KG=1.0, TG=0.05,
    ),
    "st8c": st8c.Par(
        TR=0.02, KPR=5.0, KIR=3.0, VPImax=20.0, VPImin=0.0, KPA=4.0, KIA=2.0, VAmax=20.0, VAmin=-20.0, KA=1.0,
        TA=0.05, VRmax=20.0, VRmin=-20.0, KF=0.5, TF=0.02, KC1=0.1, KP=4.0, KI2=0.5, KC2=0.05,
    ),
    "st8c fed by the terminals": st8c.Par(
        TR=0.02, KPR=5.0, KIR=3.0, VPImax=20.0, VPImin=0.0, KPA=4.0, KIA=2.0, VAmax=20.0, VAmin=-20.0, KA=1.0,
        TA=0.05, VRmax=20.0, VRmin=-20.0, KF=0.5, TF=0.02, KC1=0.1, KP=4.0, KI1=0.5, XL=0.1, THETAP=20.0, SW1=1,
    ),
}  # fmt: skip
STABILIZERS = {  # name -> stabilizer
    "ieeest": ieeest.Par(
        A1=0.06, A2=0.002, A3=0.05, A4=0.001, A5=0.05, A6=0.001, T1=0.1, T2=0.05, T3=0.1, T4=0.05, T5=2.0, T6=2.0,
        KS=3.0, VCU=1.4, VCL=0.2,
    ),
    "ieeest of power, first order": ieeest.Par(
        A1=0.06, A2=0.0, A3=0.0, A4=0.0, A5=0.03, A6=0.0, T1=0.1, T2=0.05, T3=0.1, T4=0.05, T5=2.0, T6=2.0, KS=-0.1,
        code=3,
    ),
    "st2cut": st2cut.Par(
        K1=3.0, K2=-0.1, T1=0.02, T2=0.03, T3=2.0, T4=2.0, T5=0.1, T6=0.05, T7=0.1, T8=0.05, T9=0.06, T10=0.04,
        VCU=0.6, VCL=-0.6, code1=1, code2=3,
    ),
    "stab2a": stab2a.Par(K2=1.0, T2=1.0, K3=0.3, T3=0.5, K4=0.05, K5=0.8, T5=0.05),
    "pss2b": pss2b.Par(
        TW1=2.0, TW2=2.0, T6=0.02, TW3=2.0, TW4=0.0, T7=2.0, KS2=0.25, KS3=1.0, T8=0.3, T9=0.1, KS1=5.0, T1=0.15,
        T2=0.05, T3=0.15, T4=0.05, T10=0.02, T11=0.01, code2=3,
    ),
}  # fmt: skip
