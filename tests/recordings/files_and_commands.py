"""Studies of what files may say and commands may be asked: PST, RAW, CON and overlays, designs, sweeps, remedies."""

import json
import re
from pathlib import Path

from described import described
from recordings.answers import refused
from recordings.damaged import told
from recordings.studies import GIVEN, LOOSE, SLOW, STUDIES, called, clockless, command, dampers, lines

import stabctl as st
from stabctl.io.contingencies import monitored
from stabctl.io.control_files import save_law
from stabctl.simulation.events import described as happening


def in_folder(name, slow=False, loose=1e-6):
    """Register a study that writes files into a folder; it returns a mapping of results."""

    def decorate(function):
        STUDIES[name] = lambda folder: {k: described(v) for k, v in function(Path(folder)).items()}
        LOOSE[name] = loose
        if slow:
            SLOW.add(name)
        return function

    return decorate


def changed(text, changes):
    """A text with some passages replaced, each of which it must have."""
    for old, new in changes.items():
        assert old in text, old
        text = text.replace(old, new)
    return text


def rows(table):
    """Rows of a table as short texts, anything else as it is."""
    if hasattr(table, "items"):
        return {model: {str(key): str(tuple(par)) for key, par in of.items()} for model, of in table.items()}
    return [str(tuple(one)) if hasattr(one, "_fields") else one for one in table]


GENERATION = """basmva = 90;
sys_freq = 50;
bus = [
   1  1.03  15   0.9   0.2   0    0     0     0     2;
   2  1.01   7   0.31  0.07  0.1  0.02  0     0     2;
   3  1.00   5   0.14  0.03  0.4  0.1   0.01  0.05  3;
   4  1.02  11   1.1   0.1   0.2  0.05  0     0.02  1;
   5  1.00   3   0.2   0.06  0.9  0.3   0     0     3];
line = [1  3  0  0.10  0  1.02  1.5;  3  2  0.002  0.02  0.04  1  0;  4  3  0.001  0.12  0  0.98  0;
        5  2  0.004  0.03  0.02  1  0];
mac_con = [
   1  1  120  0.15  0      1.8  0.30  0.25  8.0  0.03  1.7  0.55  0.24  0     0.05  3.5  0    1.1  1  0.04  0.3;
   2  4  100  0.12  0      1.6  0.31  0.25  7.1  0.04  1.5  0.52  0.25  0.4   0     5.0  1.2  0    4  0     0;
   3  4   90  0.1   0.002  1.9  0.33  0     6.2  0     1.2  0.41  0     0.31  0     2.9  0.7  0    4  0.05  0.2;
   4  5  150  0.1   0.001  1.5  0.28  0.21  6.0  0.04  1.4  0.46  0.21  0.35  0.06  4.1  0.6  0    5  0     0;
   5  5  700  0     0.003  0    0.19  0     0    0     0    0     0     0     0     9.1  0.8  0    5  0     0];
exc_con = [
   0  1  0.01  200  0.05  1.1  0.4  5    -5    0    0     0     0     0    0     0     0    0    0    0;
   1  2  0.02   46  0.06  0.7  0.2  3.9  -3.1  1.0  0.46  3.1   0.33  2.3  0.1   0.1   1.2  0    0    0;
   2  3  0.03   41  0.07  0    0    4.1  -3.3  1.1  0.53  2.4   0.12  3.2  0.31  0.09  1.3  0    0    0;
   3  4  0.0   7.2  0.4   6.7  1.1  10  -10    0.2  -0.2  200   4.4   19   5.1   0.09  1.1  6.3  1    6.4;
   0  5  0.0   1.2  0.4   0    0    1    -1    0    0     0     0     0    0     0     0    0    0    0];
pss_con = [1  1  100  10  0.05  0.01  0.06  0.02  0.2  -0.05;
           2  2  90   11  0.05  0.01  0.06  0.02  0.2  -0.05;
           1  3  80   9   0.07  0.02  0.08  0.03  0    0;
           1  4  80   0   0.07  0.02  0.08  0.03  0.1  -0.1];
tg_con = [1  1  0.98  25  1.0  0.1  0.5  0  1.25  5.0;
          2  4  1     20  1.0  0.2  0.4  0  1.15  4.0];
sw_con = [0  0  0  0  0  0  0.01;  0.1  3  2  0  0  2  0.01;  0.15  0  0  0  0  0  0.01];
"""
STATEMENTS = """
bus(:,4:7) = bus(:,4:7)*0.9;
bus(3,7) = 0.11;
line(:,5) = line(:,5)/2;
line([3],:) = [];
mac_con(:,20:21) = zeros(3,2);
mac_con(1,16) = 6.1;
ibus_con = zeros(length(mac_con),1);
ibus_con(3) = 1;
exc_con(2,2) = 3;
gov_flag = false;
load_con(:,4) = 0.25;
load_con(:,3) = ones(2,1)/4;
load_con(:,2) = 0.4*0.8;
if ~gov_flag
  tg_con = [1  1  0.98  21  0.9  0.12  0.51  0.1  1.2  4.9];
else
  tg_con = [];
end
if (gov_flag),
  pss_con = [];
end
lmon_con = [1:3]';
load pst_var
svc_con(:,3) = 4;
"""


@in_folder("statements of PST files")
def _(folder):
    pair = (GIVEN / "pair.m").read_text(encoding="utf-8")
    path, found = folder / "more.m", {}
    texts = {
        "statements": changed(pair, {"basmva = 110;": "basmva = 220/2; sys_freq = 50;"}) + STATEMENTS,
        "held voltage": changed(GENERATION, {"5   0.14  0.03  0.4": "5   0     0     0.4"}),
        "load buses": changed(GENERATION, {"0.1  0.02  0     0     2;": "0.1  0.02  0     0     3;"}),
    }
    for name, text in texts.items():
        path.write_text(text, encoding="utf-8")
        case = st.load(path)
        tables = ("loads",) if name == "load buses" else ("buses", "branches", "machines", "loads", "devices", "notes")
        found |= {f"{name} {table}": rows(getattr(case, table)) for table in tables}
        found[f"{name} flow"] = case.power_flow().df
    return found


WRONG_PST = {
    "flag": "if nobody\nend",
    "open": "gov_flag = 1;\nif gov_flag",
    "none": "bus = [];",
    "range": "line = [5:1 2 3 4 5 6 7];",
    "zero": "line(:,3) = 2/0;",
    "large": "line(:,3) = 1e299*1e9;",
    "function": "bus = loadflow(bus, line);",
    "text": "bus = 'none';",
    "columns": "line(:,4:3) = 2;",
    "others": "line(:,4:5) = line(:,3);",
    "no row": "line(9,:) = [];",
    "no element": "line(2,19) = 3;",
    "another": "line(:,4) = bus(:,3);",
    "size": "ibus_con = zeros(n,1);",
    "flags": "ibus_con = [1; 0];",
    "frequency": "sys_freq = -50;",
    "kind": "bus(2,10) = 7;",
    "shares": "load_con(:,2) = 0.9;",
    "machines": "mac_con(2,1) = 1;",
    "rating": "mac_con(2,3) = 0;",
    "share": "mac_con(:,22:23) = zeros(3,2);",
    "whole": "bus(3,1) = 3.5;",
    "exciters": "exc_con(2,2) = 1;",
    "no machine": "exc_con(2,2) = 9;",
    "no bus": "line(2,1) = 9;",
    "saturation": "exc_con = [0 1 0 9 0.1 0 0 5 -5; 1 2 0 20 0.1 0 0 5 -5 1 0.5 3 0.3 0 0.1 0.1 1];",
    "exciter": "exc_con = [0 1 0 9 0.1 0 0 5 -5; 4 2 0 20 0.1 0 0 5 -5];",
    "fault": "sw_con(2,6) = 3;",
}


@in_folder("mistakes in PST files")
def _(folder):
    pair = (GIVEN / "pair.m").read_text(encoding="utf-8")
    return {name: told(st.load, folder / "wrong.m", [pair, text]) for name, text in WRONG_PST.items()}


MORE_RAW = {
    "0 / END OF VSC DC LINE DATA": "'VSC 1', 1, 0.7\n203, 1, 2\n208, 2, 1\n'VSC 2', 0, 0.7\n203, 1, 2\n208, 2, 1\n"
    "0 / END OF VSC DC LINE DATA",
    "0 / END OF MULTI-TERMINAL DC DATA": "'MANY', 2, 1, 1, 1\n203, 1\n208, 2\n1, 0\n1, 1\n"
    "0 / END OF MULTI-TERMINAL DC DATA",
    "0 / END OF FACTS DATA": "'SVC 1', 203, 0, 1\n'SVC 2', 203, 0, 0\n0 / END OF FACTS DATA",
    "0 / END OF SWITCHED SHUNT DATA\nQ": "0 / END OF SWITCHED SHUNT DATA\n'NODE', 'M', 1, 203, 12, 0, 1\n1, 2\n"
    "3, 4\n5, 6\n7, 8\n"
    "0 / END OF GNE DATA\n202, 'I', 1\n203, 'I', 0\n0 / END\nQ",
    "0.9, 33, 0": "0.9, 33, 3",
    "1, 2, 2, 83.0": "1, 2, 2, 84.0",
    "204, '2', 47.0, 8.0, 30.0, -20.0, 1.021": "204, '2', 47.0, 8.0, 30.0, -20.0, 1.027",
    "205, 'GEN B', 11.0, 2": "205, 'GEN B', 11.0, 1",
}
NEWER = """0, 75.0, 34, 0, 0, 60.0 / a newer file
Breakers and distributed generation

GENERAL, THRSHZ=0.0001, PQBRAK=0.61
RATING, 1, "RATE1", "RATING SET 1"
0 / END OF SYSTEM-WIDE DATA, BEGIN BUS DATA
11, 'ONE', 110.0, 3, 1, 1, 1, 1.02, 0.4
12, 'TWO', 110.0, 1, 1, 1, 1, 1.010133, -0.92174
13, 'THREE', 110.0, 2, 1, 1, 1, 1.010353, -0.67149
14, 'FOUR', 110.0, 1, 1, 1, 1, 1.010241, -0.68567
0 / END OF BUS DATA
12, '1', 1, 1, 1, 31.0, 9.0, 0.0, 0.0, 0.0, 0.0, 1, 1, 0, 4.5, 1.5, 1
14, '1', 1, 1, 1, 22.0, 7.0, 3.0, 1.0, 2.0, -4.0, 1, 1, 0, 4.5, 1.5, 0
0 / END OF LOAD DATA
0 / END OF FIXED SHUNT DATA
11, '1', 30.0, 9.0, 100.0, -100.0, 1.02, 0, 88.0, 0.003, 0.21
13, '1', 17.0, 5.5, 5.5, -5.0, 1.04, 0, 41.0, 0.0, 0.24
0 / END OF GENERATOR DATA
11, 12, '1', 0.01, 0.08, 0.02, '', 0,0,0,0,0,0,0,0,0,0,0,0, 0.001, 0.002, 0.003, -0.004
12, 13, '1', 0.012, 0.09, 0.03, '', 0,0,0,0,0,0,0,0,0,0,0,0, 0, 0, 0, 0
11, 13, '1', 0.014, 0.11, 0.01, '', 0,0,0,0,0,0,0,0,0,0,0,0, 0, 0, 0, 0
0 / END OF BRANCH DATA
13, 14, '@1', 0.0007
12, 14, '*2', 0.0009, 0,0,0,0,0,0,0,0,0,0,0,0, 0
0 / END OF SWITCHING DEVICE DATA
0 / END OF TRANSFORMER DATA
Q
"""
FIXED = NEWER.replace("'THREE', 110.0, 2", "'THREE', 110.0, 1").replace("1.04, 0, 41.0", "1.02, 0, 41.0")
OLDER = """0, 60.0
Buses with shunts
no version
21, 'ONE', 20.0, 3, 0.0, 0.0, 1, 1, 1.03, 0.0, 1
22, 'TWO', 20.0, 1, 1.5, 6.5, 1, 2, 0.98, -3.0, 2
23, 'THREE', 20.0, 2, 0.0, -2.5, 1, 2, 1.01, -4.0, 2
0
22, '1', 1, 1, 1, 27.0, 8.0, 0.0, 0.0, 0.0, 0.0, 1
0
21, '1', 20.0, 3.0, 50.0, -40.0, 1.03, 0, 70.0, 0.004, 0.22
23, '1', 11.0, 3.0, 50.0, -40.0, 1.01, 22, 30.0, 0.0, 0.25
0
21, 22, '1', 0.02, 0.11, 0.03
22, 23, '1', 0.03, 0.13, 0.01
0
0
Q
"""


@in_folder("versions of RAW files")
def _(folder):
    five = (GIVEN / "five.raw").read_text(encoding="utf-8")
    there, found = folder / "versions", {}
    there.mkdir(exist_ok=True)
    (there / "five.DYR").write_bytes((GIVEN / "five.dyr").read_bytes())
    keep = {"missing": "injection", "missing_controls": "fixed"}
    for name, text in {"five": changed(five, MORE_RAW), "newer": NEWER, "fixed": FIXED, "older": OLDER}.items():
        (there / f"{name}.raw").write_text(text, encoding="utf-8")
        case = st.load(there / f"{name}.raw", **(keep if name == "five" else {}))
        tables = ("notes",) if name in ("five", "fixed") else ("buses", "branches", "machines", "loads", "notes")
        found |= {f"{name} {table}": rows(getattr(case, table)) for table in tables}
        found |= {f"{name} flow": case.power_flow().df, f"{name} case": str(case)}
    typical = st.load(there / "newer.raw", machines="typical", loads="current", conventions="psse")
    return found | {"typical": rows(typical.devices), "loads": rows(typical.loads), "said": typical.notes}


WRONG_RAW = {
    "version": ("33, 0, 0, 50.0", "36, 0, 0, 50.0"),
    "base": ("0, 90.0, 33", "0, -90.0, 33"),
    "kind": ("110.0, 1, 2, 2, 2, 0.9970", "110.0, 7, 2, 2, 2, 0.9970"),
    "load twice": ("203, 'X', 1", "203, '1', 1"),
    "machine twice": ("205, 'B', 8.0", "205, '1', 8.0"),
    "no bus": ("203, 208, '1', 0.017", "203, 209, '1', 0.017"),
    "ratio": ("0.004, 0.09, 1.02", "0.004, 0.09, 0"),
    "code": ("205, 203, 0, '1', 1, 2, 1", "205, 203, 0, '1', 1, 4, 1"),
    "rating": ("0.0043, 0.098, 90.0", "0.0043, 0.098, -90"),
    "losses": ("190000.0, 0.11, 85.0", "19000000.0, 0.11, 85.0"),
    "no-load losses": ("41000.0, 0.004", "4100000.0, 0.004"),
    "no voltage": ("204, 'GEN A', 15.0", "204, 'GEN A', 0"),
    "mode": ("'LINE 1', 1", "'LINE 1', 4"),
    "current": ("'LINE 1', 1, 4.1, 23.0", "'LINE 1', 2, 4.1, -230"),
    "scheduled": ("'LINE 1', 1, 4.1, 23.0, 95.0", "'LINE 1', 1, 4.1, 23.0, 0"),
    "too much": ("'LINE 1', 1, 4.1, 23.0, 95.0", "'LINE 1', 1, 4.1, -2300, 95.0, 0.0, 9"),
    "terminals": ("0 / END OF VSC DC LINE DATA", "'VSC 1', 1, 0.7\n203, 1, 2\n0 / END OF VSC DC LINE DATA"),
    "not whole": ("0 / END OF MULTI-TERMINAL DC DATA", "'MANY', x, 1, 1\n0 / END OF MULTI-TERMINAL DC DATA"),
    "isolated": ("203, '2', 0, 0.0, 33.0", "207, '2', 1, 0.0, 33.0\n207, '3', 1, 0.0, 3.0"),
    "isolated load": ("202, '9', 0, 1", "207, '9', 1, 1"),
    "table": ("0.99, 0.0\n204", "0.99, 0.0, 0,0,0,0, 0,0,0,0,0,0,0, 4\n204"),
    "cut": ("0 / END OF TRANSFORMER DATA", "Q\n0 / END OF TRANSFORMER DATA"),
}
LOADED = {
    "missing": lambda there: st.load(there / "five.raw", missing="none"),
    "nothing missing": lambda there: st.load(there / "five.raw", there / "five.dyr"),
    "frequency": lambda there: st.load(there / "five.raw", frequency=50),
    "models": lambda there: st.load(there / "nine.m", missing="injection"),
    "machines": lambda there: st.load(there / "nine.m", machines="usual"),
    "machines of a folder": lambda there: st.load("two_area", machines="typical"),
    "dyr": lambda there: st.load("two_area", there / "five.dyr"),
    "no file": lambda there: st.load(there / "none.raw"),
    "ending": lambda there: st.load(there / "grid.con"),
    "folder": lambda there: st.load(there),
    "wrong machines": lambda there: st.load("two_area", machines="any"),
    "several": lambda there: st.read_contingencies(there / "some.toml", st.load("two_area"), there / "grid.sub"),
}


@in_folder("mistakes in RAW files")
def _(folder):
    five = (GIVEN / "five.raw").read_text(encoding="utf-8")

    def read(path):
        return st.read_psse(path, missing="injection", missing_controls="fixed")

    found = {name: told(read, folder / "wrong.raw", [changed(five, {a: b})]) for name, (a, b) in WRONG_RAW.items()}
    return found | {f"loaded, {name}": refused(call, folder) for name, call in LOADED.items()}


SUBSYSTEMS = """SUBSYSTEM 'WEST'
AREA 1
BUS 205
END
SYSTEM EAST JOIN AREAS 2 3
KVRANGE 100 390
END END
SUBSYSTEM 'PART' JOIN 'both'
ZONES 2 3
OWNER 1
END
BUSES 204 205
KV 380
END
END
"""
CON = """CONTINGENCY 'BUS 203'
OPEN BUS 203
END
CONTINGENCY 'THREE ENDS'
OPEN BRANCH FROM BUS 201 TO BUS 203 TO BUS 206 CKT 2
REMOVE LOAD X FROM BUS 203
END
CONTINGENCY 'AGAIN'
OPEN THREEWINDING AT BUS 201 TO BUS 206 TO BUS 203 CKT 1
END
CONTINGENCY 'LOAD'
REMOVE LOAD FROM BUS 208
END
CONTINGENCY 'UNIT'
REMOVE UNIT B FROM BUS 205
TRIP LINE FROM BUS 202 TO BUS 203 CIRCUIT 2
END
CONTINGENCY 'MORE'
SET BUS 202 SHUNT TO 3 MVAR
INCREASE BUS 203 LOAD BY 7 MW
END
CONTINGENCY 'LESS'
CHANGE BUS 208 LOAD BY -30 PERCENT
REDUCE BUS 203 SHUNT BY 40 PERCENT
END
CONTINGENCY 'SET'
SET BUS 208 LOAD TO 11 MW
END
CONTINGENCY 'SHUNT'
DISCONNECT SWSHUNT FROM BUS 208
DISCONNECT SHUNT 1 FROM BUS 208
END
SKIP
FROM BUS 202 TO BUS 208 CKT 1
202 TO 203 CKT '2'
END
SINGLE BRANCH FROM BUS 202
SINGLE TIE FROM SUBSYSTEM 'WEST'
BUSDOUBLE LINE IN SUBSYSTEM 'WEST'
SINGLE LINE IN SYSTEM 'EAST'
PARALLEL LINE IN SYSTEM 'WEST'
DOUBLE UNIT IN SUBSYSTEM 'WEST'
BUSES IN SUBSYSTEM 'PART'
END
"""
MON = """MONITOR VOLTAGE RANGE ALL BUSES 0.91 1.09
MONITOR VOLTAGE RANGE AREA 2 0.92
MONITOR VOLTAGE RANGE OWNER 1 0.93 1.08
MONITOR VOLTAGE RANGE KV 15 0.94 1.07
MONITOR VOLTAGE RANGE ZONE 3 0.95 1.06
MONITOR VOLTAGE DEVIATION BUS 203 0.04 0.05
MONITOR TIES FROM SUBSYSTEM 'WEST'
MONITOR BRANCHES
202 203 1
202 208
END
MONITOR INTERFACE 'cut' RATING 70 MW
201 202 1
END
END
"""
NOT_THERE = {
    "name": "CONTINGENCY",
    "twice": "CONTINGENCY A\nOPEN BUS 203\nEND\nCONTINGENCY A\nEND",
    "not closed": "CONTINGENCY A\nOPEN BUS 203",
    "inside": "CONTINGENCY A\nCONTINGENCY B",
    "nothing": "CONTINGENCY A\nEND",
    "no statement": "END",
    "close": "CONTINGENCY A\nCLOSE LINE FROM BUS 202 TO BUS 203",
    "move": "CONTINGENCY A\nMOVE 10 MW LOAD FROM BUS 202 TO BUS 203",
    "dispatch": "CONTINGENCY A\nOPEN BUS 203 DISPATCH",
    "generation": "CONTINGENCY A\nSET BUS 204 GENERATION TO 3 MW",
    "unit": "CONTINGENCY A\nSET BUS 203 LOAD TO 3 MVAR",
    "no load": "CONTINGENCY A\nREMOVE LOAD FROM BUS 204",
    "no such load": "CONTINGENCY A\nREMOVE LOAD 7 FROM BUS 203",
    "no shunt": "CONTINGENCY A\nREMOVE SHUNT FROM BUS 201",
    "too much": "CONTINGENCY A\nDECREASE BUS 208 LOAD BY 120 PERCENT",
    "no change": "CONTINGENCY A\nCHANGE BUS 208 LOAD BY 0 PERCENT",
    "named above": "CONTINGENCY A\nREMOVE UNIT 1 FROM BUS 205\nREMOVE UNIT 1 FROM BUS 205",
    "no machine": "CONTINGENCY A\nREMOVE UNIT 7 FROM BUS 205",
    "no branch": "CONTINGENCY A\nOPEN LINE FROM BUS 204 TO BUS 208",
    "no circuit": "CONTINGENCY A\nOPEN LINE FROM BUS 202 TO BUS 203 CKT 7",
    "no windings": "CONTINGENCY A\nOPEN LINE FROM BUS 201 TO BUS 203 TO BUS 206 CKT 9",
    "early end": "CONTINGENCY A\nOPEN LINE FROM BUS 202 TO",
    "no word": "CONTINGENCY A\nOPEN LINE FROM BUS 202 BUS 203",
    "skip": "SKIP\n202 TO 203",
    "kind": "SINGLE UNIT IN SUBSYSTEM 'EAST'",
    "subsystem": "SINGLE TIE FROM SUBSYSTEM 'EST'",
    "quote": "CONTINGENCY 'A",
    "after the end": "CONTINGENCY A\nOPEN BUS 203\nEND\nEND\nSINGLE LINE FROM BUS 202",
}
NO_SUBSYSTEM = {
    "no end": "SUBSYSTEM A\nBUS 203",
    "no end of the file": "SUBSYSTEM A\nBUS 203\nEND",
    "none": "END",
    "more": "SUBSYSTEM A\nBUS 203\nEND\nEND\nBUS 204",
    "no subsystem": "BUS 203",
    "inside": "SUBSYSTEM A\nSUBSYSTEM B",
    "no name": "SUBSYSTEM",
    "twice": "SUBSYSTEM A\nBUS 203\nEND\nSUBSYSTEM a",
    "joined twice": "SUBSYSTEM A\nJOIN 'x'\nJOIN 'y'",
    "empty": "SUBSYSTEM A\nEND",
    "disjoint": "SUBSYSTEM A\nJOIN\nKV 380\nAREA 2\nEND",
    "selector": "SUBSYSTEM A\nARES 1",
    "value": "SUBSYSTEM A\nAREAS 1",
    "area": "SUBSYSTEM A\nAREA 7",
    "range": "SUBSYSTEM A\nBUSES 204 203",
}
NOT_MONITORED = {
    "empty range": "MONITOR VOLTAGE RANGE ALL BUSES 1.05 0.95",
    "nothing": "END",
    "no such bus": "MONITOR VOLTAGE RANGE KV 99 0.9 1.1",
    "not closed": "MONITOR BRANCHES\n202 203 1",
    "flows": "MONITOR LINES IN SUBSYSTEM 'NORTH'",
}


@in_folder("statements of contingencies")
def _(folder):
    case = st.read_psse(GIVEN / "five.raw", missing="injection", missing_controls="fixed")
    sub, con, mon = (folder / f"own.{kind}" for kind in ("sub", "con", "mon"))
    found = {}

    def said(path, text, call):
        path.write_text(text + "\n", encoding="utf-8")
        try:
            return call()
        except st.StabctlError as error:
            return str(error)

    sub.write_text(SUBSYSTEMS, encoding="utf-8")
    several = said(con, CON, lambda: st.read_contingencies(con, case, sub))
    found["contingencies"] = [
        f"{c.label}: {', '.join(happening(one) for one in c.with_clear('6cyc').timed(case)[1:])}" for c in several
    ]
    found["changes"] = {c.label: c.after for c in several if any(hasattr(one, "bus") for one in c.after)}
    ranges = said(mon, MON, lambda: monitored(mon, case, sub))
    found["monitored"] = {str(bus): list(limits) for bus, limits in sorted(ranges.voltages.items())}
    found["not monitored"] = ranges.remarks()
    for name, text in NOT_THERE.items():
        found[f"contingencies, {name}"] = said(con, text, lambda: st.read_contingencies(con, case, sub))
    for name, text in NOT_MONITORED.items():
        found[f"monitored, {name}"] = said(mon, text, lambda: monitored(mon, case, sub))
    found["no subsystems"] = said(con, "SINGLE TIE FROM SUBSYSTEM 'EAST'", lambda: st.read_contingencies(con, case))
    con.write_text(CON, encoding="utf-8")
    for name, text in NO_SUBSYSTEM.items():
        found[f"subsystems, {name}"] = said(sub, text, lambda: st.read_contingencies(con, case, sub))
    return found


OVERLAY = {
    "case.toml": 'extends = "second"\ntitle = "with other values"\nconventions = "psse"\n',
    "buses.csv": "bus,v_pu\n4,1.013\n",
    "machines.csv": "machine,p_mw\n24,77\n21,128\n",
    "genrou.csv": "machine,H_s\n22,2.6\n",
    "storage.csv": "machine,bus,rating_mw\n24,5,8\n",
}
NO_OVERLAY = {
    "no case": ("case.toml", 'extends = "third"\n'),
    "itself": ("case.toml", 'extends = "overlaid"\n'),
    "another": ("case.toml", 'extends = "other"\n'),
    "twice": ("machines.csv", "machine,p_mw\n24,77\n24,78\n"),
    "new": ("machines.csv", "machine,p_mw\n29,77\n"),
    "new device": ("genrou.csv", "machine,H_s\n23,2.6\n"),
    "value": ("genrou.csv", "machine,H_s\n22,-2.6\n"),
    "wrong base": ("machines.csv", "machine,base_mva\n24,0\n"),
    "no column": ("machines.csv", "p_mw\n24\n"),
    "columns twice": ("machines.csv", "machine,p_mw,p_mw\n24,1,1\n"),
    "cells": ("machines.csv", "machine,p_mw\n24\n"),
    "empty": ("machines.csv", ""),
    "no text": ("machines.csv", "machine,p_mw\n24,1_0\n"),
    "quote": ("machines.csv", 'machine,p_mw\n"24,77\n'),
    "entry": ("case.toml", 'extends = "second"\nnames = "x"\n'),
    "entry's kind": ("case.toml", 'extends = "second"\nbase_mva = "x"\n'),
    "conventions": ("case.toml", 'extends = "second"\nconventions = "eu"\n'),
    "table": ("sexx.csv", "machine,K\n24,77\n"),
    "copies": ("storage.csv", "machine,bus,rating_mw\n24,5,8\n24,5,8\n"),
}


@in_folder("overlays")
def _(folder):
    there, other = folder / "overlaid", folder / "other"
    for one in (there, other):
        one.mkdir(exist_ok=True)
        for name, text in OVERLAY.items():
            (one / name).write_text(text, encoding="utf-8")
    case, base = st.load(there), st.load(folder / "second")
    found = {"case": str(case), "title": case.title, "notes": case.notes, "flow": case.power_flow().df}
    for table in ("buses", "machines", "storage"):
        found[table] = sorted({*rows(getattr(case, table))} - {*rows(getattr(base, table))})
    found["genrou"] = {k: str(tuple(v)) for k, v in case.devices["genrou"].items()}
    for name, (file, text) in NO_OVERLAY.items():
        (there / file).write_text(text, encoding="utf-8")
        found[name] = refused(lambda _: st.load(there), None) or "read"
        (there / file).write_text(OVERLAY[file], encoding="utf-8") if file in OVERLAY else (there / file).unlink()
    (folder / "file").write_text("", encoding="utf-8")
    found["written to a file"] = refused(lambda _: st.write(case, folder / "file" / "x"), None)
    found["written elsewhere"] = refused(lambda _: st.write(st.load("wscc9"), there), None)
    twice = (folder / "second" / "genrou.csv").read_text(encoding="utf-8").splitlines()
    (there / "case.toml").unlink()
    st.write(base, folder / "two")
    (folder / "two" / "genrou.csv").write_text("\n".join([*twice, twice[1], twice[2]]), encoding="utf-8")
    found["copies of a device"] = refused(lambda _: st.load(folder / "two"), None)
    return found


LISTED = (
    "cases", "cases --json", "tables pss --csv", "tables sexs --json", "tables storage", "models", "models --json",
    "models gencls --json", "models dera1", "models regc_a",
)  # fmt: skip


def listings(folder):
    """Packaged cases, tables and models."""
    found = {}
    for text in LISTED:
        code, out, err = called(*text.split(" "))
        found[text] = {"exit": code, "out": some(out), "err": lines(err)}
    return found


def some(text, most=40):
    """Lines of a text, of long ones some."""
    if text.startswith("{"):
        return clockless(json.loads(text))
    every = lines(text)
    return every if len(every) <= most else every[:: -(-len(every) // most)]


SECOND_METHOD = re.compile("collocation|Hamiltonian")  # of rounding errors
SWINGS = (
    "swing table1 --H 3.3 --Pm 0.6 --cycles 5 --cycles 11 --plot swing.png",
    "swing table1 --X 0.8 --json",
    "swing equal-area --H 2.9 --Pc 0.15 --cycles 7 --plot area.svg",
    "swing feedback --Kv 0.03 --cycles 12 --Pm 0.45 --plot laws.pdf",
    "swing minimum-time --cycles 5 --Pc 0.4 --H1 1.2 --json --plot time.png",
    "swing minimum-time --cycles 7 --Pc 0.6 --Pc-min -0.2 --H1 1.1",
    "swing minimum-time --cycles 60 --Pc 0.01",
    "swing minimum-time --cycles 60 --Pc 0.01 --json",
)


def swings(folder):
    """Theory of one machine as commands, without the difference of two methods."""
    found = {}
    for text in SWINGS:
        code, out, err = called(*text.split(" "))
        kept = [line for line in (some(out) if out.startswith("{") else lines(out)) if not SECOND_METHOD.search(line)]
        found[text] = {"exit": code, "out": some(out) if out.startswith("{") else kept, "err": lines(err)}
    return found | {"written": sorted(one.name for one in Path(folder).glob("*.*") if one.stem in ("swing", "area", "laws", "time"))}


WRONG_CALLS = (
    "tables pass", "tables --csv", "models gensex", "import five.raw five.dyr --dyr five.dyr",
    "import five.raw --missing injection", "import nine.m --missing injection --out x", "cases two_area",
    "simulate mixed --clear 3cyc", "simulate mixed --at 2s", "simulate mixed --fault-impedance 0.1,0",
    "simulate mixed --fault 20 --clear 3cyc --fault-impedance 0.1", "simulate mixed --channels speed",
    "simulate mixed --angle-reference 7", "simulate mixed --out run.txt", "simulate mixed --out nowhere/run.csv",
    "simulate mixed --plot mixed", "simulate mixed --report five.raw", "simulate mixed --set pss.1.K",
    "simulate mixed --storage 5MW --storage-at 7=5MW", "simulate two_area --lag 20ms", "simulate mixed --lag -3",
    "simulate two_area --control bang-bang", "simulate two_area --deadband 20mHz", "simulate mixed --max-angle 0",
    "simulate two_area --pmu-rate 30", "simulate two_area --estimator kalman", "simulate two_area --controller x.toml",
    "clearing-time mixed --fault 30 --at 2s", "screen mixed --faults P1 --contingencies some.toml",
    "screen mixed --subsystems grid.sub", "screen mixed --out s.txt", "screen mixed --faults P3",
    "study mixed --subsystems grid.sub", "study mixed some.txt", "study mixed a.toml b.toml", "study mixed --clear 0cyc",
    "design pod mixed --rank --damping 0.2", "design pod mixed --fault 30", "design law two_area",
    "design law two_area --fault 7 --from-screen 3", "design law two_area --from-screen 3 --trip 7-8",
    "design tune mixed --stages 2 --damper deviation:7,order:7@20", "design tune mixed --damper deviation:7", "design tune mixed --dyr-out x.dyr",
    "design tune mixed --machine 7 --levels 1,x", "estimate two_area --fault 7 --estimator ideal --pmu-rate 30",
    "estimate two_area --fault 7 --estimator frequency --engine filterpy", "estimate mixed --fault 30 --clear 3cyc --observe 0.04",
    "modes mixed --controller one.toml --sensitivity", "modes mixed --controller one.toml --sparse", "simulate two_area --controller law.toml", "simulate two_area --storage 9MW --controller law.toml --deadband 20mHz", "simulate two_area --storage 9MW --controller law.toml --controller law.toml", "weak-grid mixed --converter 7 --scr 1,x",
    "place two_area --seed 3", "sweep run runs.toml --out x.db --workers 2 --scheduler y", "verify nothing",
    "linearize mixed --inputs storage --outputs speed --out m.txt", "sweep show none.db",
)  # fmt: skip


def wrong_calls(folder):
    """What is said of options that do not go together."""
    dampers()[0].save(Path(folder) / "one.toml")
    save_law(st.StorageLaw((), 2.0), Path(folder) / "law.toml")
    found = {}
    for text in WRONG_CALLS:
        code, out, err = called(*text.split(" "))
        found[text] = [code, *lines(out + err)[:4]]
    return found


SECOND = "design {} second --storage-at 21@2=17MW,24=11MW "
COMMANDS = {
    "listings": listings,
    "swings": swings,
    "wrong options": wrong_calls,
    "design lqr": command(
        SECOND.format("lqr") + "--output order:21@2 --input deviation --speed 90mHz --angle 3deg --effort 0.6"
        " --out lqr.toml", "lqr.toml",
    ),
    "design lqg": command(
        SECOND.format("lqg") + "--input deviation,flow:2-5 --rate 50 --delay 40ms --order 8 --noise 1.5"
        " --disturbance 7MW --speed 0.1 --effort 0.8",
    ),
    "design pod --rank": command(SECOND.format("pod") + "--rank --input deviation,flow:2-5 --output order,vs --delay 80ms"),
    "design optimum": command(
        "design optimum two_area --classical --fault 7 --trip 7-8 --storage-at 1=40MW,4=30MW --window 1s --rate 20"
        " --iterations 2 --resolution 1cyc --observe 2 --longest 0 --energy 4kWh --out schedule.csv --plot schedule.png",
        "schedule.csv", page=True,
    ),
}  # fmt: skip
STUDIES |= COMMANDS
SLOW |= {"design optimum", "swings"}
LOOSE |= dict.fromkeys(COMMANDS, 1e-3)
