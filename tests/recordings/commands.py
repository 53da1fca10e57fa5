"""Studies of commands: listings, theory of one machine, options that do not go together, and designs."""

import json
import re
from pathlib import Path

from recordings.studies import LOOSE, SLOW, STUDIES, called, clockless, command, dampers, lines

import stabctl as st
from stabctl.io.control_files import save_law

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
