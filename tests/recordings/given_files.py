"""Studies of what files may say: statements and mistakes of PST and RAW files, and overlays."""

from recordings.answers import refused
from recordings.damaged import told
from recordings.studies import GIVEN, recorded

import stabctl as st


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


@recorded("statements of PST files")
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


@recorded("mistakes in PST files")
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


@recorded("versions of RAW files")
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


@recorded("mistakes in RAW files")
def _(folder):
    five = (GIVEN / "five.raw").read_text(encoding="utf-8")

    def read(path):
        return st.read_psse(path, missing="injection", missing_controls="fixed")

    found = {name: told(read, folder / "wrong.raw", [changed(five, {a: b})]) for name, (a, b) in WRONG_RAW.items()}
    return found | {f"loaded, {name}": refused(call, folder) for name, call in LOADED.items()}


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


@recorded("overlays")
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
