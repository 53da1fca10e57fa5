"""The numbers of the paper, each once: where it is, what it is, its digits, its unit; and statements in our words.

The paper: feedback control of distributed energy storage for transient stability, 2022, MDPI, CC BY 4.0.
"""

from .comparison import Printed

# Tables and figures with results; Figures 1, 2, 6, 8, 12, 13 and 16 are diagrams.
RESULTS = {
    "Table 1": "angle and speed when faults of 0 to 15 cycles are cleared",
    "Table 2": "constants and states of the two-machine equivalent",
    "Table 3": "commands of the controller",
    "Table 4": "gain in critical clearing time against the rating of the devices",
    "Figure 3": "phase plane: stability region and three faults, from A to B, C and D",
    "Figure 4": "equal areas A1 and A2 under the power-angle curve",
    "Figure 5a": "areas of the 15-cycle fault",
    "Figure 5b": "angle, speed and acceleration of the 15-cycle fault against time",
    "Figure 7": "the four feedback laws in the phase plane",
    "Figure 9": "equal areas of two machines (a) without and (b) with absorbed power",
    "Figure 10": "states and co-states from clearing to rest",
    "Figure 11": "absorbed power from clearing to rest",
    "Figure 14": "speeds of the four machines without and with control",
    "Figure 15": "power of the four devices",
    "Figure 17": "speeds of machines 13, 14 and some others without control",
    "Figure 18": "the same with control",
    "Figure 19": "power of the devices of machines 13 and 14",
}

ERRATA = {  # section: how its text must be read
    "2": "Read (1) as a second derivative, (2) as a first derivative, (8) and (9) with their constants of integration, "
    "and V1 as the voltage of the machine.",
    "4": "In (32), the power of the device is divided by M1 and the other powers by M, because the device acts on one "
    "machine only.",
    "6.2": "In the paper, machine 13 is at bus 33 and machine 14 at bus 31; in the data it is the other way around.",
}

# Section 2: one machine on an infinite bus
OMIB_INERTIA = Printed("Section 2.1", "inertia H", "3", "s", given=True)
OMIB_POWER = Printed("Section 2.1", "power before the fault", "0.5", "pu", given=True)
OMIB_REACTANCE = Printed("Section 2.1", "reactance, 1 and 3 pu in parallel", "0.75", "pu", given=True)
OMIB_START = Printed("Section 2.1", "rotor angle before the fault", "0.4950", "rad")
TABLE_1 = {  # cycles: angle, speed and, if there is a fault, its outcome
    cycles: (
        Printed(f"Table 1, {place}", f"angle after {cycles} cycles", angle, "rad"),
        Printed(f"Table 1, {place}", f"speed after {cycles} cycles", speed, "rad/s"),
        *(Printed(f"Figure 3, {place}", f"outcome after {cycles} cycles", text) for text in outcome),
    )
    for cycles, place, angle, speed, *outcome in (
        (0, "A", "0.4950", "0"),
        (6, "B", "0.6519", "3.1374", "stable"),
        (12, "C", "1.1228", "6.2747", "stable"),
        (15, "D", "1.4753", "7.8421", "unstable"),
    )
}
AREA = Printed("(11)", "area A1 of the 12-cycle fault and the kinetic energy at clearing", "equal")
AREAS_15 = Printed("Figure 5a", "decelerating area A2 of the 15-cycle fault", "too small")

# Section 3: feedback laws
FEEDBACK = Printed("Section 3", "laws that are stable after 15 cycles", "4 of 4")
FEEDBACK_LARGEST = Printed("Section 3", "law with the largest angle", "speed")
FEEDBACK_SECOND_SPEED = Printed("Section 3", "speed swing of the second law, compared with the first", "smaller")
FEEDBACK_THIRD_ANGLE = Printed("Section 3", "angle swing of the third law, compared with the first two", "smaller")
FEEDBACK_THIRD_SPEED = Printed("Section 3", "speed swing of the third law, compared with the first two", "smaller")
FEEDBACK_SMALLEST = Printed("Section 3", "law with the smallest swing", "size of acceleration, sign of speed")
FEEDBACK_DAMPED = Printed("Section 3", "law with the best damping", "size of acceleration, sign of speed")

# Section 4: two machines
TABLE_2 = {
    key: Printed("Table 2", what, text, unit, given=key not in ("start", "x1", "x2"))
    for key, what, text, unit in (
        ("H1", "inertia H1", "1", "s"),
        ("HCOI", "inertia HCOI", "6", "s"),
        ("V1", "voltage V1", "1", "pu"),
        ("VCOI", "voltage VCOI", "1", "pu"),
        ("Pm1", "power Pm1 = -PmCOI", "0.5", "pu"),
        ("Pc_max", "maximum absorbed power", "0.5", "pu"),
        ("Pc_min", "minimum absorbed power", "-0.5", "pu"),
        ("X", "reactance before and after the fault", "1", "pu"),
        ("start", "angle x1 before the fault", "0.5236", "rad"),
        ("x1", "angle x1 at clearing", "1.0734", "rad"),
        ("x2", "speed x2 at clearing", "10.9956", "rad/s"),
    )
}
GUESS = -0.03, 0.005  # section 4: first guess of the co-states at clearing, s/rad and s^2/rad
PULSE = Printed("Figure 11", "control from clearing to rest", "absorbs P_Cmax throughout")
CO_STATE = Printed("Section 4", "sign of lambda2 from clearing to rest", "positive")

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
CASE_1_SIZE = Printed("Section 6.1", "0.5 pu as a percentage of the rating of the machine", "5", "%")
CASE_1_OUTCOMES = {
    "without": Printed("Figure 14", "21 cycles without control", "unstable"),
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
TABLE_4_LARGEST = Printed("Table 4", "largest gain", "60", "%")
