"""A case from a PST file: its network, and its machines and controls as rows of device tables.

As PST does: per unit on 100 MVA and 60 Hz, unless basmva and sys_freq are assigned; a machine with x''d is GENROU, with
x''q = x''d, one with xd alone a two-axis machine, the others are classical. The stator voltage of GENROU is
multiplied by the speed. Demands are impedances but for the shares in load_con, and so is generation at a bus without a
machine. Reactances of infinite buses (ibus_con) are those behind which their machines have a constant voltage.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from stabctl._util.errors import CaseError, shown
from stabctl._util.units import quantity
from stabctl._util.validation import checks_arguments
from stabctl.devices.exciters import dc
from stabctl.model import tables as model_tables
from stabctl.model.case import Case
from stabctl.model.tables import Branch, Bus, Load, Machine

from .._lexer import Place, not_utf8
from .._table_builder import TableBuilder, without_owner
from ..psse.dyr import Unsupported
from . import tables
from .tables import Pst, Row

BASE, FREQUENCY = 100.0, 60.0  # MVA, Hz   unless the file assigns basmva, sys_freq
KINDS = {1: "swing", 2: "pv", 3: "pq"}
HELD = (1, 2)
OPEN = 999.0  # s   open-circuit time constant that PST gives a q-axis circuit without one
LOW = 0.1  # pu   voltage below which a load is an impedance; PST has no such limit
MODELS = ("ind_con", "mld_con", "igen_con", "svc_con", "tcsc_con", "ess_con", "dcsp_con", "dcl_con", "dcc_con")
ROLES = {"mac_con": "machine", "exc_con": "exciter", "pss_con": "stabilizer", "tg_con": "governor", "load_con": "load"}
WIDEST = 30  # columns, filled with zeros


class Import(NamedTuple):
    """What was read from a PST file: the case, what was changed or replaced, what is not modeled, and its rows."""

    case: Case
    corrections: tuple[str, ...]
    unsupported: tuple[Unsupported, ...]
    kinds: tuple[tuple[str, str, int, int], ...]  # matrix, role, rows, and those of them that the case holds


@checks_arguments
def read_pst(path: str | Path, *, frequency: float | str | None = None) -> Case:
    """Read a system from a data file of the Power System Toolbox. It is read as data: no code in it is run.

    Parameters
    ----------
    path : str or Path
        The file, ending in .m.
    frequency : float or str, Hz, optional
        Rated frequency, instead of sys_freq of the file or 60 Hz.

    Returns
    -------
    Case
        With the bus and machine numbers of the file. What was corrected or left out is in its `notes`.

    Raises
    ------
    CaseError
        For the first mistake, with file and line.

    Examples
    --------
    >>> list(st.read_pst("pair.m").devices)
    ['genrou', 'sexs', 'pss', 'tgov']
    """
    return read(path, frequency=frequency).case


def read(path: str | Path, *, frequency: float | str | None = None) -> Import:
    """What `read_pst` reads, with what was corrected and left out."""
    return _Reader(tables.read(Path(path)), frequency).found()


class _Reader:
    """Rows of the tables of a case while they are collected from a PST file."""

    def __init__(self, file: Pst, frequency: float | str | None) -> None:
        self.file = file
        self.base = self._positive("basmva", BASE)
        self.hertz = self._positive("sys_freq", FREQUENCY) if frequency is None else quantity(frequency, "Hz")
        self.net = TableBuilder(self.base)
        self.rows: dict[str, dict[int, Any]] = defaultdict(dict)
        self.places: dict[str, list[Place]] = defaultdict(list)
        self.unsupported = [
            Unsupported(name, place, "it is not modeled") for name, place in file.unread.items() if name in MODELS
        ]
        self.machines: dict[int, Row] = {}
        self.infinite: set[int] = set()
        self.alone: dict[int, complex] = {}  # MVA   generation at buses without a machine

    def _positive(self, name: str, usual: float) -> float:
        value = self.file.scalars.get(name, usual)
        if value <= 0:
            raise CaseError(f"{self.file.path}: {name} = {value:g} is not allowed; it must be more than 0.")
        return value

    def found(self) -> Import:
        """The case and what was said on the way."""
        self._buses()
        for row in self.file.of("load_con"):
            self._bus(row.values[0], row.place, "load_con")
        self._branches()
        self._machines()
        for table, controls in (("exc_con", _exciter), ("pss_con", _stabilizer), ("tg_con", _governor)):
            self._controls(table, controls)
        names = {number: f"machine {number}" for number in self.machines}
        self.net.corrections += without_owner(self.rows, self.places, names)
        self.net.reference()
        apart = self.net.settle_islands(str(self.file.path))
        self._generation()
        self.net.idle()
        self.net.reference()
        self.net.storage_buses()
        left = [name for name in self.file.unread if name not in MODELS]
        said = [f"{self.file.path}: not represented: {', '.join(left)}."] if left else []
        corrections = (*not_utf8(self.file.path), *self.net.corrections, *apart, *said, *self._disturbance())
        case = self.net.case(
            self.file.path,
            self.places,
            devices={model: dict(rows) for model, rows in self.rows.items()},
            base_mva=self.base,
            frequency_hz=self.hertz,
            title=f"PST system {self.file.path.stem}",
            source=f"PST {self.file.path.name}",
            notes=(*corrections, *map(str, self.unsupported)),
        )
        lost = Counter(one.kind for one in self.unsupported)
        rows = {table: len(self.file.of(table)) for table in ROLES}
        kinds = [(table, ROLES[table], n, n - lost[table]) for table, n in rows.items() if n]
        return Import(case, corrections, tuple(self.unsupported), tuple(kinds))

    def _bus(self, number: float, place: Place, table: str) -> int:
        """The number of a bus in the file."""
        if number not in self.net.at:
            raise place.error(f"there is no bus {number:g}.", table)
        return int(number)

    def _buses(self) -> None:
        shares = {}
        for row in self.file.of("load_con"):
            number = _whole(row, 1, "load_con")
            shares[number] = row.values[1:5]
        at = {row.values[1] for row in self.file.of("mac_con")}
        for row in self.file.of("bus"):
            number, kind = _whole(row, 1, "bus"), _whole(row, 10, "bus")
            v, angle, pg, qg, p, q, g, b = row.values[1:9]
            if number in self.net.at:
                raise row.place.error(f"bus {number} appears twice.", "bus")
            if kind not in KINDS:
                raise row.place.error(f"{kind} is not a type of bus; it must be 1, 2 or 3.", "bus")
            rated = row.values[12] if len(row.values) > 12 else 0.0
            values = v, angle, self.base * g, self.base * b, rated
            self.net.add("buses", Bus(number, KINDS[kind], *values), row.place)  # type: ignore[arg-type]
            if p or q:
                self._load(row, number, shares.get(number, [0.0] * 4))
            if number not in at and (pg or qg or kind in HELD):
                self.alone[number] = complex(pg, qg) * self.base

    def _load(self, row: Row, number: int, shares: list[float]) -> None:
        p, q = (self.base * value for value in row.values[5:7])
        if any(not 0 <= share <= 1 for share in shares) or shares[0] + shares[2] > 1 or shares[1] + shares[3] > 1:
            text = f"the shares of the load at bus {number} are not between 0 and 1 in sum."
            raise row.place.error(text, "load_con")
        p_power, q_power, p_current, q_current = shares
        self.net.add("loads", Load(number, p, q, p_power, q_power, p_current, q_current, LOW), row.place)

    def _branches(self) -> None:
        count: Counter[frozenset[int]] = Counter()
        for row in self.file.of("line"):
            a, b = (self._bus(end, row.place, "line") for end in row.values[:2])
            r, x, charging, tap, shift = row.values[2:7]
            count[frozenset((a, b))] += 1
            circuit = str(count[frozenset((a, b))])
            self.net.branch(Branch(a, b, r, x, charging, tap or 1.0, shift, circuit), row.place)

    def _machines(self) -> None:
        rows = self.file.of("mac_con")
        units = Counter(row.values[1] for row in rows)
        flags = self.file.of("ibus_con")
        if flags and len(flags) != len(rows):
            raise flags[0].place.error(f"ibus_con has {len(flags)} elements; it needs one for each row of mac_con.")
        powers = {row.values[0]: row.values[3:5] for row in self.file.of("bus")}
        for k, row in enumerate(rows):
            m, number = _wide(row), _whole(row, 1, "mac_con")
            bus, base = self._bus(m[1], row.place, "mac_con"), m[2]
            if number in self.machines:
                raise row.place.error(f"machine {number} appears twice.", "mac_con")
            if base <= 0:
                raise row.place.error(f"{base:g} MVA is not allowed; it must be more than 0.", "mac_con")
            shares = m[21:23] if any(m[21:23]) else (1 / units[m[1]],) * 2
            if units[m[1]] > 1 and not any(m[21:23]):
                text = f"the machines at bus {bus} have no shares (columns 22, 23); they are taken as equal."
                self._said(row.place, text)
            p, q = (self.base * share * power for share, power in zip(shares, powers[bus], strict=True))
            self.machines[number] = row
            self.net.add("machines", Machine(number, bus, base, p, bus, q), row.place)
            if flags and flags[k].values[0]:
                self.infinite.add(number)
            self._model(number, m, row.place)

    def _model(self, number: int, m: list[float], place: Place) -> None:
        """The device of a machine."""
        H, D, ra, (xd, x1d, x2d, T1d, T2d, xq, x1q, x2q, T1q, T2q), S10, S12 = m[15], m[16], m[4], m[5:15], m[19], m[20]
        if number in self.infinite:
            self._device("gencls", number, place, H=0.0, D=0.0, ra=ra, x1d=x2d or x1d or xd)
        elif xd == 0 or (x2d == 0 and T1d == 0):
            if ra and xd == 0:
                self._said(place, f"machine {number} is classical; its resistance of {ra:g} pu is left out, as in PST.")
                ra = 0.0
            self._device("gencls", number, place, H=H, D=D, ra=ra, x1d=x1d)
        else:
            circuits = {"T2d": T2d, "T2q": T2q, "x2": x2d} if x2d and T2d else {}
            changed = []
            if circuits and x2q != x2d:
                changed.append(f"x''q = {x2q:g} pu becomes x''d = {x2d:g} pu, as in PST")
            if circuits and T2q == 0:
                x1q, circuits["T2q"] = x2d, OPEN
                changed.append(f"T''q0 = 0 becomes {OPEN:g} s and x'q becomes x''q = {x2d:g} pu, as in PST")
            elif not circuits and x1q not in (0, x1d):
                changed.append(
                    f"x'q = {x1q:g} pu stays beside x'd = {x1d:g} pu; the stator of PST has x'd on both axes"
                )
            x1q = x1q or (x1d if not circuits else xq if T1q == 0 else 0.0)
            if T1q == 0 and (x1q != xq or (circuits and S10 and S12)):
                T1q = OPEN
                changed.append(f"T'q0 = 0 becomes {OPEN:g} s, as in PST")
            if (S10 or S12) and circuits:
                changed.append("its saturation is that of PSS/E's GENROU, in PST 3 of E'q alone, in PSTess none")
            elif S10 or S12:
                changed.append("it has no subtransient circuits; its saturation is left out")
            for text in changed:
                self._said(place, f"machine {number}: {text}.")
            values = {"H": H, "D": D, "ra": ra, "xd": xd, "x1d": x1d, "T1d": T1d, "xq": xq, "x1q": x1q, "T1q": T1q}
            if circuits:
                values |= circuits | {"xl": m[3], "S10": S10, "S12": S12, "speed_factor": 1}
            self._device("genrou" if circuits else "two_axis", number, place, **values)
        if m[17]:
            self._said(place, f"machine {number}: damping relative to the mean speed (column 18) is left out.")

    def _generation(self) -> None:
        """Generation at buses without a machine, as impedances; where they hold a voltage, after a power flow."""
        self.alone = {bus: power for bus, power in self.alone.items() if bus in self.net.at}
        held = [bus for bus in self.alone if self.net.bus(bus).kind != "pq"]
        self._injected(bus for bus in self.alone if bus not in held)
        if held:
            machines, places = list(self.net.rows["machines"]), list(self.net.places["machines"])
            for bus in held:
                self.net.add("machines", Machine(self.net.new_number(), bus, self.base, self.alone[bus].real, bus), "")
            flow = self.net.case(self.file.path, devices={}, base_mva=self.base, frequency_hz=self.hertz).power_flow()
            self.alone |= dict(zip(held, flow.S[-len(held) :] * self.base, strict=True))
            for bus, V in zip(self.net.at, flow.V, strict=True):
                angle = float(np.angle(V, deg=True))
                if bus in held:
                    self.net.change(bus, kind="pq", v=float(abs(V)), angle=angle)
                elif self.net.bus(bus).kind == "pv":  # it may become the swing bus
                    self.net.change(bus, angle=angle)
            self.net.rows["machines"], self.net.places["machines"] = machines, places
            self._injected(held)

    def _injected(self, buses: Iterable[int]) -> None:
        for bus in buses:
            power, place = self.alone[bus], self.net.places["buses"][self.net.at[bus]]
            if power:
                load = Load(bus, -power.real, -power.imag, v_low=LOW, id="G", kind="injection")
                self.net.add("loads", load, place)
            what = f"generation of {power.real:.4g} MW and {power.imag:.4g} Mvar"
            self._said(place, f"bus {bus} has no machine; its {what} is an impedance, as in PST.")

    def _controls(self, table: str, made: Callable[[list[float]], "Control | str"]) -> None:
        """Exciters, stabilizers or governors; those of classical machines are left out."""
        for row in self.file.of(table):
            number = _whole(row, 2, table)
            if number not in self.machines:
                raise row.place.error(f"there is no machine {number}.", table)
            found = made(_wide(row))
            if isinstance(found, str):
                reason, owner = found, f"machine {number}"
                self.unsupported.append(Unsupported(table, row.place, reason, owner, str(number)))
                continue
            classical = number in self.rows.get("gencls", {})
            if number in self.infinite or (classical and table != "tg_con"):
                what = "an infinite bus" if number in self.infinite else "a classical machine"
                self._said(row.place, f"{table} of machine {number} is left out, because it is {what}.")
                continue
            for sentence in found.said:
                self._said(row.place, f"machine {number}: {sentence}")
            self._device(found.model, number, row.place, **found.values)

    def _device(self, model: str, number: int, place: Place, **values: Any) -> None:
        if number in self.rows[model]:
            raise place.error(f"machine {number} has a second {model}.")
        self.rows[model][number] = model_tables.parameters(model, **values)
        self.places[model].append(place)

    def _said(self, place: Place, text: str) -> None:
        self.net.corrections.append(f"{place}: {text}")

    def _disturbance(self) -> list[str]:
        """What sw_con says, as the options of a command."""
        rows = self.file.of("sw_con")
        if len(rows) < 3:
            return []
        place, (at, bus, far, _, _, kind, *_) = rows[1].place, _wide(rows[1])
        if kind != 0:
            return [f"{place}: sw_con describes another disturbance than a three-phase fault, which is not read."]
        clear, remote = (rows[k].values[0] if k < len(rows) else rows[2].values[0] for k in (2, 3))
        trip = f" --trip {bus:g}-{far:g}" if far else ""
        text = f"{place}: sw_con is --fault {bus:g}{trip} --at {at:g}s --clear {clear - at:.4g}s"
        later = f"; its far end opens {remote - clear:.4g} s later, here with the near end" if remote > clear else ""
        return [f"{text}{later}."]


class Control(NamedTuple):
    """A control: its model, its parameters, and what was changed."""

    model: str
    values: dict[str, float]
    said: Sequence[str] = ()


def _exciter(e: list[float]) -> Control | str:
    """The exciter of a row of exc_con, or why there is none."""
    kind, _, TR, KA, TA, TB, TC, high, low = e[:9]
    first = {"TR": TR, "KA": KA, "TA": TA}
    if kind == 0:
        return Control("sexs", {**first, "TB": TB, "TC": TC, "Efdmax": high, "Efdmin": low})
    if kind in (1, 2):
        KE, TE, E1, SE1, E2, SE2, KF, TF = e[9:17]
        if E2 == 0 and (SE1 or SE2):
            return "saturation as Asat and Bsat is not modeled; give it at two field voltages (columns 12 to 15)"
        (E1, SE1), (E2, SE2) = sorted([(E1, SE1), (E2, SE2)])
        more = {"VRmax": high, "VRmin": low, "KE": KE, "TE": TE, "KF": KF, "TF": TF}
        more |= {"E1": E1, "SE1": SE1, "E2": E2, "SE2": SE2}
        said = ["its saturation is quadratic through the two points, in PST exponential."] if SE1 or SE2 else []
        try:
            more, computed = dc.computed(more)
        except ValueError as error:
            return str(error).rstrip(".")
        said += [f"{one.rstrip('.')}, as in PSS/E, not as in PST." for one in computed]
        if kind == 1 and not (TB or TC):
            return Control("ieeet1", {**first, **more}, said)
        return Control("exdc2" if kind == 2 else "esdc1a", {**first, **more, "TB": TB, "TC": TC}, said)
    if kind == 3:
        names = ("VImax", "VImin", "KJ", "KP", "THETAP", "KI", "XL", "KC", "Emax", "KG", "VGmax")
        more = dict(zip(names, e[9:20], strict=True))
        return Control("exst3", {**first, "TB": TB, "TC": TC, "VRmax": high, "VRmin": low, **more})
    return f"exciters of type {kind:g} are not modeled"


def _stabilizer(s: list[float]) -> Control | str:
    """The stabilizer of a row of pss_con, or why there is none."""
    kind, _, gain, Tw, T1, T2, T3, T4, high, low = s[:10]
    if kind != 1:
        return "stabilizers that read the power are not modeled"
    if Tw <= 0:
        return "its washout has no time constant"
    limits = {"Vmax": high, "Vmin": low} if high or low else {"Vmax": 10.0, "Vmin": -10.0}
    return Control("pss", {"K": gain / Tw, "Tw": Tw, "T1": T1, "T2": T2, "T3": T3, "T4": T4, **limits})


def _governor(t: list[float]) -> Control | str:
    """The governor of a row of tg_con, or why there is none."""
    kind, _, reference, K, most, Ts, Tc, T3, T4, T5 = t[:10]
    if kind != 1:
        return f"governors of type {kind:g} are not modeled"
    said = (f"its speed reference of {reference:g} pu becomes 1.",) if reference not in (0, 1) else ()
    values = {"K": K, "Ts": Ts, "Tc": Tc, "T3": T3, "T4": T4, "T5": T5, "Pmax": most, "Pmin": 0.0}
    return Control("tgov", values, said)


def _wide(row: Row) -> list[float]:
    """The values of a row, with zeros after the last."""
    return row.values + [0.0] * (WIDEST - len(row.values))


def _whole(row: Row, column: int, table: str) -> int:
    """A number in a column (from 1) that must be whole."""
    value = row.values[column - 1]
    if value != int(value) or not 0 <= value < 1e9:
        raise row.place.error(f"{shown(value)} is not a whole number.", f"{table} column {column}")
    return int(value)
