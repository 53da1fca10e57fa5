"""Studies of what CON, SUB and MON files may say, and of their mistakes."""

from recordings.studies import GIVEN, recorded

import stabctl as st
from stabctl.io.contingencies import monitored
from stabctl.simulation.events import described as happening

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


@recorded("statements of contingencies")
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
