"""Studies of what files may say and commands may be asked: PST, RAW, CON and overlays, designs, sweeps, remedies."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pandas as pd
from described import described
from mixed import mixed_point, second
from recordings.answers import refused
from recordings.damaged import told
from recordings.studies import (
    GIVEN,
    LOOSE,
    SLOW,
    STUDIES,
    called,
    clockless,
    command,
    dampers,
    lines,
    recorded,
    second_point,
)

import stabctl as st
from stabctl._util.schema import fields
from stabctl.assessment.redispatch import redispatch
from stabctl.clearing.templates import contingencies as categories
from stabctl.clearing.trial import Search
from stabctl.io.contingencies import monitored
from stabctl.io.control_files import save_law
from stabctl.jobs.task import run_task
from stabctl.model import tables
from stabctl.simulation.events import described as happening
from stabctl.sweep.job import Result
from stabctl.sweep.study_file import read as read_study
from stabctl.sweep.sweep import tasks as tasks_of


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
        wanted = ("loads",) if name == "load buses" else ("buses", "branches", "machines", "loads", "devices", "notes")
        found |= {f"{name} {table}": rows(getattr(case, table)) for table in wanted}
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
        wanted = ("notes",) if name in ("five", "fixed") else ("buses", "branches", "machines", "loads", "notes")
        found |= {f"{name} {table}": rows(getattr(case, table)) for table in wanted}
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
    return found | {
        "written": sorted(one.name for one in Path(folder).glob("*.*") if one.stem in ("swing", "area", "laws", "time"))
    }


WRONG_CALLS = (
    "tables pass", "tables --csv", "models gensex", "import five.raw five.dyr --dyr five.dyr",
    "import five.raw --missing injection", "import nine.m --missing injection --out x", "cases two_area",
    "simulate mixed --clear 3cyc", "simulate mixed --at 2s", "simulate mixed --fault-impedance 0.1,0",
    "simulate mixed --fault 20 --clear 3cyc --fault-impedance 0.1", "simulate mixed --channels speed",
    "simulate mixed --angle-reference 7", "simulate mixed --out run.txt", "simulate mixed --out nowhere/run.csv",
    "simulate mixed --plot mixed", "simulate mixed --report five.raw", "simulate mixed --set pss.1.K",
    "simulate mixed --storage 5MW --storage-at 7=5MW", "simulate two_area --lag 20ms", "simulate mixed --lag -3",
    "simulate two_area --control bang-bang", "simulate two_area --deadband 20mHz", "simulate mixed --max-angle 0",
    "simulate two_area --pmu-rate 30", "simulate two_area --estimator kalman",
    "simulate two_area --controller x.toml", "clearing-time mixed --fault 30 --at 2s",
    "screen mixed --faults P1 --contingencies some.toml", "screen mixed --subsystems grid.sub",
    "screen mixed --out s.txt", "screen mixed --faults P3", "study mixed --subsystems grid.sub",
    "study mixed some.txt", "study mixed a.toml b.toml", "study mixed --clear 0cyc",
    "design pod mixed --rank --damping 0.2", "design pod mixed --fault 30", "design law two_area",
    "design law two_area --fault 7 --from-screen 3", "design law two_area --from-screen 3 --trip 7-8",
    "design tune mixed --stages 2 --damper deviation:7,order:7@20", "design tune mixed --damper deviation:7",
    "design tune mixed --dyr-out x.dyr", "design tune mixed --machine 7 --levels 1,x",
    "estimate two_area --fault 7 --estimator ideal --pmu-rate 30",
    "estimate two_area --fault 7 --estimator frequency --engine filterpy",
    "estimate mixed --fault 30 --clear 3cyc --observe 0.04", "modes mixed --controller one.toml --sensitivity",
    "modes mixed --controller one.toml --sparse", "simulate two_area --controller law.toml",
    "simulate two_area --storage 9MW --controller law.toml --deadband 20mHz",
    "simulate two_area --storage 9MW --controller law.toml --controller law.toml",
    "weak-grid mixed --converter 7 --scr 1,x", "place two_area --seed 3",
    "sweep run runs.toml --out x.db --workers 2 --scheduler y", "verify nothing",
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
    "design pod --rank": command(
        SECOND.format("pod") + "--rank --input deviation,flow:2-5 --output order,vs --delay 80ms"
    ),
    "design optimum": command(
        "design optimum two_area --classical --fault 7 --trip 7-8 --storage-at 1=40MW,4=30MW --window 1s --rate 20"
        " --iterations 2 --resolution 1cyc --observe 2 --longest 0 --energy 4kWh --out schedule.csv"
        " --plot schedule.png",
        "schedule.csv", page=True,
    ),
}  # fmt: skip
STUDIES |= COMMANDS
SLOW |= {"design optimum", "swings"}
LOOSE |= dict.fromkeys(COMMANDS, 1e-3)


@recorded("categories of contingencies")
def _():
    case = st.read_psse(GIVEN / "five.raw", GIVEN / "five.dyr", missing="injection", missing_controls="fixed")
    found = {}
    for word in ("P1", "p2@8cyc", "P4", "P5@9cyc", "P6", "P7@70ms"):
        found[word] = [
            f"{c.label}; fault at {c.fault} at {c.at}, {c.impedance:.6f}, {c.clear}; before {[*map(str, c.events)]}; "
            f"out {c.trip}, {[*map(str, c.after)]}"
            for c in categories(case, word)
        ]
    wrong = ("P3", "P8", "P1@0cyc", "P1@x")
    return found | {word: refused(lambda _, word=word: categories(case, word), None) for word in wrong}


@recorded("power is shifted", loose=1e-4)
def _():
    point, search, found = second_point(), Search(1.0, 100.0, 2.0), {}
    lost = [
        st.Contingency("2", clear="19cyc"),
        st.Contingency("5", clear="32cyc"),
        st.Contingency("2-3#1@0.3", clear="40cyc"),
        st.Contingency("4-5", clear="3cyc"),
    ]
    full = point.case.set({"machines.23.base": 81.0, "machines.24.base": 74.0}).initialize()
    others = point.case.set({"machines.22.base": 57.4, "machines.23.base": 81.0}).initialize()  # in which they are lost
    calls = {
        "one": lambda: redispatch(point, lost[:1], search),
        "several": lambda: redispatch(point, lost, search),
        "after another": lambda: redispatch(
            point, lost[:1], search, tried=[point.case.set("machines.24.p", 160.0).initialize()]
        ),
        "with a law": lambda: redispatch(point, lost[1:2], search, control=st.BangBang("20mHz")),
        "full": lambda: redispatch(full, [st.Contingency("5", clear="60cyc")], search),
        "nobody left": lambda: redispatch(point, lost[1:2], search, tried=[others]),
        "not lost": lambda: redispatch(point, lost[3:], search),
        "in vain": lambda: redispatch(point, [st.Contingency("2", clear="400cyc"), lost[1]], search),
    }
    for name, call in calls.items():
        try:
            found[name] = call()
        except st.StabctlError as error:
            found[name] = str(error)
    return found


@in_folder("a study with remedies", slow=True, loose=1e-3)
def _(folder):
    faults = [
        st.Contingency("2", name="=first"),
        st.Contingency("5", trip="5-2"),
        st.Contingency("3-5@0.2", clear="4cyc"),
    ]
    options = {"observe": "1.5s", "resolution": "1cyc", "longest": 0.0, "limit": "40cyc", "workers": 1}
    options |= {"prices": GIVEN / "prices.toml"}
    found = second_point().study(
        "19cyc", faults=faults, worst=2, damping=0.12, voltages=(0.99, 1.02), remedies="redispatch", **options
    )
    base = st.load("two_area").initialize()
    stored = base.study("32cyc", faults=[st.Contingency("9", trip="8-9")], worst=0, remedies="storage", **options)
    judged = second_point().study("19cyc", faults=faults, worst=2, criteria=GIVEN / "criteria.toml", **options)
    tuned = second_point().study("17cyc", faults=faults[:1], worst=0, damping=0.12, remedies="stabilizers", **options)
    found.save(folder / "study.xlsx")
    found.save(folder / "study.csv")
    sheets = pd.read_excel(folder / "study.xlsx", sheet_name=None)
    (last,) = tuned.remedies
    return {
        "says": found.remarks(),
        "secure": found.secure,
        "remedies": found.remedies,
        "tables": {name: frame.head(3) for name, frame in found.tables().items()},
        "table": (folder / "study.csv").read_text(encoding="utf-8").splitlines(),
        "sheets": {name: [list(frame.columns), list(frame.shape)] for name, frame in sheets.items()},
        "cell": str(sheets["contingencies"].iloc[:, 0].tolist()),
        "contributions": found.contributions(found.modes.least_damped()[0]).df.head(3),
        "rows": [one.rows() for one in found.remedies],
        "stored": stored.remarks(),
        "ratings": [one.rows() for one in stored.remedies],
        "judged": [judged.remarks(), judged.tables()["violations"].head(4)],
        "tuned": [last.solves, last.price, last.verdict, last.after.lost, last.after.margin, last.before],
    }


RULES = """title = "of every kind"
source = "a test"
unverified = "all of it"

[[voltage]]
name = "returns"
below = 0.93
recover = "0.1s"
since = "clearing"

[[voltage]]
name = "slow return"
below = 0.6
recover = "40ms"
kv = [100, 120]

[[voltage]]
name = "after recovery"
below = 1.01
since = "recovery"
recovered = 0.98
longest = "20ms"

[[frequency]]
name = "total"
above = 50.02
longest = "60ms"
total = true

[[angle]]
name = "close"
separation = "20deg"

[[angle]]
name = "far"
separation = 2.9

[[swings]]
name = "decays"
must = "decay"
"""
NO_RULES = {
    "none": 'title = "x"',
    "both": 'title = "x"\n[[voltage]]\nname = "a"\nbelow = 0.9\nabove = 1.1',
    "neither": 'title = "x"\n[[frequency]]\nname = "a"',
    "recovery": 'title = "x"\n[[voltage]]\nname = "a"\nbelow = 0.9\nrecovered = 0.95',
    "recover": 'title = "x"\n[[voltage]]\nname = "a"\nabove = 1.1\nrecover = "1s"',
    "kv": 'title = "x"\n[[voltage]]\nname = "a"\nabove = 1.1\nkv = [110, 100]',
    "time": 'title = "x"\n[[voltage]]\nname = "a"\nabove = 1.1\nlongest = "5Hz"',
    "angle": 'title = "x"\n[[angle]]\nname = "a"\nseparation = "0deg"',
    "key": 'title = "x"\n[[angle]]\nname = "a"\nseparatin = "9deg"',
    "hertz": 'title = "x"\nfrequency_hz = 60\n[[swings]]\nname = "a"\nmust = "decay"',
    "area": 'title = "x"\n[[voltage]]\nname = "a"\nabove = 1.1\nareas = [7]\nkv = [100, 400]',
}


@in_folder("criteria of every kind", loose=1e-5)
def _(folder):
    path = folder / "rules.toml"
    path.write_text(RULES.replace("separation = 2.9", 'separation = "2.9"'), encoding="utf-8")
    rules = refused(lambda _: st.criteria(path), None)
    path.write_text(RULES.replace("separation = 2.9", 'separation = "95deg"'), encoding="utf-8")
    fault, short = st.Contingency("2-3#1@0.3", clear="9cyc", trip="2-3#1", at=0.1), second_point()
    runs = {
        "run": short.simulate(fault, "1.4s"),
        "short": short.simulate(fault, "0.3s"),
        "lost": short.simulate(st.Contingency("5", clear="33cyc", at=0.1), "2s"),
        "long": short.simulate(fault, "4s"),
        "islands": mixed_point().simulate(["30-40#1@0.1s", "30-40#2@0.2s", "1002-1003#1@0.3s"], "1s"),
    }
    every = {name: run.judge(path) for name, run in runs.items()}
    found = {name: [str(one), [tuple(v)[:4] for v in one.violations], one.unstable] for name, one in every.items()}
    found |= {"a number": rules, "criteria": st.criteria(path), "table": every["lost"].df}
    for name, text in NO_RULES.items():
        path.write_text(text, encoding="utf-8")
        found[f"no rules, {name}"] = refused(lambda _: runs["short"].judge(path), None)
    found["not recorded"] = refused(lambda _: short.simulate(fault, "0.3s", record=False).judge("entso-e"), None)
    return found


GRID = """kind = "simulate"
case = "second"
fault = { text = "2-3#1@{}", from = 0.25, to = 0.75, count = 2 }
clear = "5cyc"
at_s = "60ms"
until_s = "0.4s"
fault_r_pu = 0.002
fault_x_pu = 0.004

[[job]]
trip = "2-3#1"

[job.set]
"pss.21.K" = [4.0, 9.0]
tgov = { "24" = { K = 14.5 } }

[[job]]
fault = "5"
clear = "34cyc"
until_s = 2
max_angle_rad = 2.0

[job.set]
"loads.2.p" = { from = 150, to = 160, step = 10.0 }

[[job]]
case = "two_area"
fault = "7"
storage = "30MW"
storage_energy_mwh = 0.01
lag_s = "20ms"
deadband_hz = "30mHz"

[[job]]
case = "two_area"
machines = "classical"
fault = "9"
storage = "30MW"
estimator = "frequency"
pmu_rate = 50
seed = 3.0
until_s = 1
"""
TIMES = """kind = "clearing-time"
case = "second"
fault = ["2", 5]
resolution = "1cyc"
observe_s = 1
longest_s = 0
limit = "40cyc"
scan = 0
coi = "machines"
"""
NO_SWEEP = {
    "job": "job = 3",
    "kind": 'kind = "run"',
    "no kind": 'case = "second"',
    "no case": 'kind = "simulate"\nclear = "3cyc"\ncase = "third"',
    "grid": GRID.replace("count = 2", "step = -0.1"),
    "grid's text": GRID.replace("2-3#1@{}", "2-3#1"),
    "both": GRID.replace("count = 2", "count = 2, step = 0.1"),
    "set": GRID.replace('"pss.21.K"', '"pss.22.K"'),
    "set a text": GRID.replace("seed = 3.0", 'set = "x"'),
    "classical": GRID.replace("seed = 3.0", 'set = {"pss.1.K" = 9}'),
    "late": GRID.replace('until_s = "0.4s"', 'until_s = "0.1s"'),
    "no bus": GRID.replace('fault = "9"', 'fault = "99"'),
    "trip": GRID.replace('trip = "2-3#1"', 'trip = "2-3#7"'),
    "storage": GRID.replace('storage = "30MW"\nest', 'storage = "30"\nest'),
    "no effect": TIMES.replace("scan = 0", "lag_s = 0.1"),
    "rate": GRID.replace("pmu_rate = 50", "pmu_rate = 61"),
    "unit": GRID.replace('"30mHz"', '"30s"'),
    "controller": GRID.replace("pmu_rate = 50", 'pmu_rate = 50\ncontroller = "none.toml"'),
    "limit": TIMES.replace("40cyc", "0.5cyc"),
    "key": TIMES.replace("scan", "scam"),
    "cycles": GRID.replace('"60ms"', '"3cyc"'),
}


OUTCOME = [f.column for f in fields(Result).values()]


@in_folder("jobs of sweeps", loose=1e-4)
def _(folder):
    path, found = folder / "jobs.toml", {}
    for name, text in {"runs": GRID, "times": TIMES}.items():
        path.write_text(text, encoding="utf-8")
        for k, task in enumerate(tasks_of(read_study(path), path)):
            row = run_task(task)
            given = {key: value for key, value in task.job.given().items() if value not in (None, "", 0.0)}
            found[f"{name}, job {k}"] = [
                ", ".join(f"{key}={given[key]}" for key in ("case", "fault", "trip", "clear", "set") if key in given),
                row.about.status, row.about.message,
                {key: v for key, v in row.values.items() if key in OUTCOME and v is not None},
            ]  # fmt: skip
    for name, text in NO_SWEEP.items():
        path.write_text(text, encoding="utf-8")
        found[f"no sweep, {name}"] = refused(lambda _: tasks_of(read_study(path), path), None)
    found["comma"] = refused(lambda _: st.run_sweep(path, folder / "x.db", controllers=["a,b.toml"]), None)
    found["both"] = refused(lambda _: st.run_sweep(path, folder / "x.db", workers=1, scheduler="x"), None)
    return found


WRONG_CASES = {
    "row": lambda c: replace(c, buses=(*c.buses, 3)),
    "model": lambda c: replace(c, devices={**c.devices, "sexx": {}}),
    "no buses": lambda c: replace(c, buses=()),
    "name": lambda c: replace(c, name="a\nb"),
    "title": lambda c: replace(c, title="a\x07"),
    "no swing bus": lambda c: c.set("buses.3.kind", "pv"),
    "no machine": lambda c: c.set("buses.5.kind", "pv"),
    "scheduled": lambda c: c.set("buses.4.kind", "pq"),
    "no impedance": lambda c: c.set({"branches.5-2.r": 0.0, "branches.5-2.x": 0.0}),
    "one bus": lambda c: replace(c, branches=(*c.branches, c.branches[0]._replace(to_bus=1))),
    "shares": lambda c: c.set("loads.2.q_power", 0.7),
    "key": lambda c: replace(c, devices={**c.devices, "pss": {"x": c.devices["pss"][21]}}),
    "load": lambda c: with_rows(c, "cim", 4),
    "owner": lambda c: with_rows(c, "sexs", 29),
    "two": lambda c: with_rows(c, "sexs", 21),
    "exciter": lambda c: with_rows(c, "sexs", 23),
    "of a converter": lambda c: with_rows(c, "reec_b", 21),
    "stabilizer": lambda c: replace(c.without_device("ieeet1", 22), devices=moved(c, "pss", 21, 22, "ieeet1")),
    "limits": lambda c: c.set({"pss.21.Vmin": 0.3}),
    "storage": lambda c: stored(c, 0, machine=29),
    "small converter": lambda c: stored(c, 0, mva=3.0),
    "store": lambda c: replace(
        c, storage=(c.storage[0]._replace(storage_model="supercap_regc", energy=0.0, lag=0.0, ramp=0.0),)
    ),
    "characteristic": lambda c: stored(c, 1, storage_model="regc", lag=0.0, ramp=0.0),
    "two swing buses": lambda c: c.set("buses.4.kind", "swing"),
    "island": lambda c: replace(c, branches=c.branches[:-3]),
    "path": lambda c: c.set(3, 4),
    "no path": lambda c: c.set("pss", 4),
    "part of a path": lambda c: c.set("pss..K", 4),
    "unit": lambda c: c.set("storage.21.rating", "5kV"),
    "share of MVA": lambda c: c.set("machines.24.p", "31%mva").machine(24),
    "text": lambda c: c.set("machines.24.bus", "4 "),
    "no parameter": lambda c: c.with_device("sexs", 22, KX=3.0),
    "needs": lambda c: c.without_device("ieeet1", 22).with_device("sexs", 22),
    "another exciter": lambda c: c.with_device("sexs", 22, TR=0.0, KA=70.0, TA=0.03).devices["sexs"],
    "no device": lambda c: c.without_device("tgov", 22),
    "column of a load": lambda c: c.with_load(2, 30, q_powr=0.3),
    "two loads": lambda c: c.with_load(2, 30, id="n").with_load(2, 40),
    "parts": lambda c: c.with_load(2, 30, id="m").loads,
    "tripped": lambda c: c.trip_machine(24).buses[3],
    "the only one": lambda c: c.trip_machine(23),
    "classical": lambda c: replace(
        c, devices={"regc_a": {m.machine: tables.parameters("regc_a") for m in c.machines}}
    ).classical(),
    "fleet": lambda c: c.with_storage(["9MW"]),
    "place": lambda c: c.with_storage("x=9MW"),
    "no size": lambda c: c.with_storage("21=9MW,22"),
    "twice": lambda c: c.with_storage("21=9MW,21@1=5MW,21=3MW"),
    "large": lambda c: c.with_storage("2e9MW"),
    "energy": lambda c: c.with_storage("9MW", storage_model="supercap_regc"),
    "voltage": lambda c: c.with_storage("9MW", mva="0.8pu"),
    "mva": lambda c: c.with_storage("9MW", mva="50%", storage_model="regc"),
    "option": lambda c: c.with_storage("9MW", lagg="3ms"),
    "no branch": lambda c: st.Contingency("4-2", clear="3cyc").check(c),
    "no bus": lambda c: st.Contingency("4-9", clear="3cyc").check(c),
    "no circuit": lambda c: st.Contingency("2-3 ckt 9", clear="3cyc").check(c),
    "location": lambda c: st.Contingency("2-3-5-7", clear="3cyc").check(c),
    "at a circuit": lambda c: c.simulate(["2-3@0.4@1s"], "1s"),
    "spread": lambda c: st.replicate(c, 2, spread=12.0),
    "no converter": lambda c: replace(c, storage=()).short_circuit_ratio(),
    "no models": lambda c: replace(c, devices={}).short_circuit(),
    "typical": lambda c: c.with_typical_machines(),
}


def stored(case, k, **values):
    """The case with one storage device, some values of which are others."""
    return replace(case, storage=(case.storage[k]._replace(**values),))


def converters(case):
    """A converter in place of every machine."""
    return {m.machine: tables.parameters("regc_a") for m in case.machines}


def moved(case, model, old, new, without):
    """The devices with a row of a model also at another key, which loses a row of a further model."""
    rows_of = {name: dict(table) for name, table in case.devices.items()}
    rows_of[without].pop(new)
    rows_of.setdefault(model, {})[new] = rows_of[model][old]
    return rows_of


def with_rows(case, model, key):
    """The case with a row of a model at a key."""
    needed = {"TR": 0.01, "KA": 70.0, "TA": 0.02} if model == "sexs" else {}
    return replace(case, devices={**case.devices, model: {key: tables.parameters(model, **needed)}})


@recorded("wrong cases and edits")
def _():
    def told_of(change):
        try:
            found = change(second())
        except st.StabctlError as error:
            return str(error)
        except TypeError as error:
            return type(error).__name__
        return str(found)

    return {name: told_of(change) for name, change in WRONG_CASES.items()}
