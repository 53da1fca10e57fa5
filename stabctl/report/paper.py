"""What the paper prints, each number once: where it stands, what it is, its digits, its unit. Statements in own words.

The paper: feedback control of distributed energy storage for transient stability, 2022, MDPI, CC BY 4.0.
"""

from .study import Printed

# What every table and figure with results shows; Figures 1, 2, 6, 8, 12, 13 and 16 are diagrams without any.
RESULTS = {
    "Table 1": "angle and speed when faults of 0 to 15 cycles are cleared",
    "Table 2": "constants and states of the two-machine equivalent",
    "Table 3": "what the controller does",
    "Table 4": "gain in critical clearing time against the power of the devices",
    "Figure 3": "phase plane: stability region and three faults, from A to B, C and D",
    "Figure 4": "equal areas A1 and A2 under the power-angle curve",
    "Figure 5a": "areas of the 15-cycle fault",
    "Figure 5b": "angle, speed and acceleration of the 15-cycle fault in time",
    "Figure 7": "the four feedback laws in the phase plane",
    "Figure 9": "equal areas of two machines (a) without and (b) with absorbed power",
    "Figure 10": "states and co-states from release to rest",
    "Figure 11": "absorbed power from release to rest",
    "Figure 14": "speeds of the four machines without and with control",
    "Figure 15": "power of the four devices",
    "Figure 17": "speeds of machines 13, 14 and some others without control",
    "Figure 18": "the same with control",
    "Figure 19": "power of the devices of machines 13 and 14",
}

ERRATA = {  # section: what its text is read with
    "2": "Read with (1) as a second derivative, (2) as a first one, (8) and (9) with their constant of integration, "
    "and V1 as the voltage of the machine.",
    "4": "In (32) the device acts with 1/M1 and the other powers with 1/M, as they must: it pushes one machine only.",
    "6.2": "In the paper machine 13 is at bus 33 and machine 14 at bus 31; in the data it is the other way round.",
}

# Section 2: one machine on an infinite bus
OMIB_INERTIA = Printed("Section 2.1", "inertia H", "3", "s", given=True)
OMIB_POWER = Printed("Section 2.1", "power before the fault", "0.5", "pu", given=True)
OMIB_REACTANCE = Printed("Section 2.1", "reactance, 1 and 3 pu in parallel", "0.75", "pu", given=True)
OMIB_START = Printed("Section 2.1", "rotor angle before the fault", "0.4950", "rad")
TABLE_1 = {  # cycles: angle, speed and, where there is a fault, its fate
    cycles: (
        Printed(f"Table 1, {place}", f"angle after {cycles} cycles", angle, "rad"),
        Printed(f"Table 1, {place}", f"speed after {cycles} cycles", speed, "rad/s"),
        *(Printed(f"Figure 3, {place}", f"fate after {cycles} cycles", text) for text in fate),
    )
    for cycles, place, angle, speed, *fate in (
        (0, "A", "0.4950", "0"),
        (6, "B", "0.6519", "3.1374", "stable"),
        (12, "C", "1.1228", "6.2747", "stable"),
        (15, "D", "1.4753", "7.8421", "lost"),
    )
}
AREA = Printed("(11)", "area A1 of the 12-cycle fault and the kinetic energy at clearing", "equal")
AREAS_15 = Printed("Figure 5a", "decelerating area A2 of the 15-cycle fault", "too small")

# Section 3: feedback laws
FEEDBACK = Printed("Section 3", "laws that survive 15 cycles", "4 of 4")
FEEDBACK_WIDEST = Printed("Section 3", "law with the largest angle", "speed")
FEEDBACK_SECOND_SPEED = Printed("Section 3", "speed swing of the second law, to the first", "narrower")
FEEDBACK_THIRD_ANGLE = Printed("Section 3", "angle swing of the third law, to the first two", "narrower")
FEEDBACK_THIRD_SPEED = Printed("Section 3", "speed swing of the third law, to the first two", "narrower")
FEEDBACK_NARROWEST = Printed("Section 3", "law with the narrowest swing", "size of acceleration, sign of speed")
FEEDBACK_DAMPED = Printed("Section 3", "law that damps quickest", "size of acceleration, sign of speed")

# Section 4: two machines
TABLE_2 = {
    key: Printed("Table 2", what, text, unit, given=key not in ("start", "x1", "x2"))
    for key, what, text, unit in (
        ("H1", "inertia H1", "1", "s"),
        ("HCOI", "inertia HCOI", "6", "s"),
        ("V1", "voltage V1", "1", "pu"),
        ("VCOI", "voltage VCOI", "1", "pu"),
        ("Pm1", "power Pm1 = -PmCOI", "0.5", "pu"),
        ("Pc_max", "greatest absorbed power", "0.5", "pu"),
        ("Pc_min", "least absorbed power", "-0.5", "pu"),
        ("X", "reactance before and after the fault", "1", "pu"),
        ("start", "angle x1 before the fault", "0.5236", "rad"),
        ("x1", "angle x1 at release", "1.0734", "rad"),
        ("x2", "speed x2 at release", "10.9956", "rad/s"),
    )
}
GUESS = -0.03, 0.005  # section 4: first guess of the co-states at release, s/rad and s^2/rad
PULSE = Printed("Figure 11", "control from release to rest", "absorbs P_Cmax throughout")
CO_STATE = Printed("Section 4", "sign of lambda2 from release to rest", "positive")

# Section 5: the controller
DEADBAND = Printed("Section 5", "deadband", "100", "mHz", given=True)
GATE = Printed("Section 5", "voltage below which a device idles", "0.8", "pu", given=True)
TABLE_3 = {
    "faster": Printed("Table 3", "machine faster than the rest", "absorbs"),
    "slower": Printed("Table 3", "machine slower than the rest", "injects"),
    "as fast": Printed("Table 3", "machine as fast as the rest", "idles"),
}

# Section 6.1: four machines
CASE_1_CYCLES = 21
CASE_1_SIZE = Printed("Section 6.1", "0.5 pu in percent of the machine's rating", "5", "%")
CASE_1_FATES = {
    "without": Printed("Figure 14", "21 cycles without control", "lost"),
    "with": Printed("Figure 14", "21 cycles with control", "stable"),
}
CASE_1_FIRST = {
    machine: Printed("Figure 15", f"first action of device {machine}", action)
    for machine, action in ((1, "absorbs"), (2, "absorbs"), (3, "injects"), (4, "injects"))
}

# Section 6.2: the reduced Western system
CASE_2_CYCLES = 6
CASE_2_SIZES = {
    what: Printed("Section 6.2", what, text, given=True)
    for what, text in (("machines", "34"), ("buses", "123"), ("branches", "171"), ("HVDC links", "2"), ("loads", "19"))
}
CASE_2_LOST = Printed("Figure 17", "machines that lose synchronism after 6 cycles", "13 and 14")
CASE_2_HELD = Printed("Figure 18", "6 cycles with control", "stable")
CASE_2_ACT = Printed("Figure 19", "devices that act", "13 and 14")
CASE_2_ACTIONS = {
    13: Printed("Figure 19", "actions of device 13", "absorbs"),
    14: Printed("Figure 19", "actions of device 14", "absorbs, injects, absorbs"),
}
TABLE_4 = {
    percent: Printed("Table 4", f"gain with devices of {percent} %", gain, "%")
    for percent, gain in ((0, "0"), (5, "20"), (15, "40"), (20, "60"), (25, "60"), (30, "60"))
}
TABLE_4_GREATEST = Printed("Table 4", "greatest gain of those tried", "60", "%")
