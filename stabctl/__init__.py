"""stabctl: controller design and linear analysis for transient stability with energy storage.

>>> import stabctl as st
>>> base = st.load("two_area").initialize()
>>> fault = st.Contingency("7-8@0.4", clear="21cyc")
>>> run = base.simulate(fault, storage="50MW", control=st.BangBang())

Every name is imported when it is first used.
"""

from importlib import import_module

TYPE_CHECKING = False  # importing typing takes longer than the rest, and Ctrl-C is not yet handled here
if TYPE_CHECKING:
    from stabctl import design
    from stabctl._util.errors import StabctlError
    from stabctl.assessment.prices import Prices
    from stabctl.assessment.remedy import Remedy
    from stabctl.assessment.result import Study
    from stabctl.assessment.study import study
    from stabctl.clearing.critical_time import ClearingTime, clearing_time
    from stabctl.clearing.screen import screen
    from stabctl.clearing.screen_result import Screen
    from stabctl.controllers import BangBang, Controller, Feedback, Gate, StorageLaw
    from stabctl.devices import register
    from stabctl.dynamics.operating_point import OperatingPoint, initialize
    from stabctl.estimation.estimate import estimate
    from stabctl.estimation.estimates import Estimates
    from stabctl.estimation.estimator_control import EstimatorControl
    from stabctl.estimation.pmu import BadPmu, Pmu
    from stabctl.estimation.rotor_units import ProcessNoise
    from stabctl.io import load, write
    from stabctl.io import packaged as cases
    from stabctl.io.contingencies import read_contingencies
    from stabctl.io.control_files import load as load_controller
    from stabctl.io.import_report import ImportReport, import_report
    from stabctl.io.matpower import read_matpower
    from stabctl.io.psse import read_psse
    from stabctl.io.pst import read_pst
    from stabctl.judgment.criteria import Criteria, criteria
    from stabctl.judgment.judged import Judged
    from stabctl.model.case import Case
    from stabctl.model.powerflow import PowerFlow
    from stabctl.model.powerflow import solve as power_flow
    from stabctl.model.replicate import replicate
    from stabctl.model.short_circuit import ShortCircuit, ShortCircuitRatio, short_circuit, short_circuit_ratio
    from stabctl.model.tables import Storage
    from stabctl.model.unusual import UnusualData, check
    from stabctl.placement.place import place
    from stabctl.placement.site_options import SiteOption
    from stabctl.placement.siting import Costs, Siting
    from stabctl.simulation.contingency import Contingency
    from stabctl.simulation.criterion import Criterion
    from stabctl.simulation.events import Clear, Fault, LoadStep, Open, SwitchShunt, TripMachine
    from stabctl.simulation.simulate import simulate
    from stabctl.simulation.trajectory import Trajectory
    from stabctl.smallsignal import linearize
    from stabctl.smallsignal.analysis import modes
    from stabctl.smallsignal.closed_loop import ClosedLoop, closed_loop
    from stabctl.smallsignal.delayed_loop import DelayedModes
    from stabctl.smallsignal.limit_cycles import LimitCycles, limit_cycles
    from stabctl.smallsignal.margins import Margins, margins
    from stabctl.smallsignal.weak_grid import WeakGrid, weak_grid
    from stabctl.sweep.results import Results as SweepResults
    from stabctl.sweep.results import read as read_sweep
    from stabctl.sweep.sweep import run_sweep
    from stabctl.verification.compare import Verification, verify

_WHERE = {
    "BadPmu": "estimation.pmu:BadPmu",
    "BangBang": "controllers:BangBang",
    "Case": "model.case:Case",
    "Clear": "simulation.events:Clear",
    "ClosedLoop": "smallsignal.closed_loop:ClosedLoop",
    "ClearingTime": "clearing:ClearingTime",
    "Contingency": "simulation.contingency:Contingency",
    "Controller": "controllers:Controller",
    "Costs": "placement.siting:Costs",
    "Criteria": "judgment:Criteria",
    "Criterion": "simulation.criterion:Criterion",
    "DelayedModes": "smallsignal.delayed_loop:DelayedModes",
    "Estimates": "estimation.estimates:Estimates",
    "EstimatorControl": "estimation.estimator_control:EstimatorControl",
    "Fault": "simulation.events:Fault",
    "Feedback": "controllers:Feedback",
    "Gate": "controllers:Gate",
    "Judged": "judgment:Judged",
    "LimitCycles": "smallsignal.limit_cycles:LimitCycles",
    "LoadStep": "simulation.events:LoadStep",
    "Margins": "smallsignal.margins:Margins",
    "Open": "simulation.events:Open",
    "ImportReport": "io.import_report:ImportReport",
    "OperatingPoint": "dynamics.operating_point:OperatingPoint",
    "Pmu": "estimation.pmu:Pmu",
    "PowerFlow": "model.powerflow:PowerFlow",
    "ProcessNoise": "estimation.rotor_units:ProcessNoise",
    "Prices": "assessment.prices:Prices",
    "Remedy": "assessment.remedy:Remedy",
    "Screen": "clearing:Screen",
    "ShortCircuit": "model.short_circuit:ShortCircuit",
    "ShortCircuitRatio": "model.short_circuit:ShortCircuitRatio",
    "SweepResults": "sweep.results:Results",
    "StabctlError": "_util.errors:StabctlError",
    "SiteOption": "placement.site_options:SiteOption",
    "Siting": "placement.siting:Siting",
    "Storage": "model.tables:Storage",
    "StorageLaw": "controllers:StorageLaw",
    "Study": "assessment:Study",
    "SwitchShunt": "simulation.events:SwitchShunt",
    "Trajectory": "simulation.trajectory:Trajectory",
    "TripMachine": "simulation.events:TripMachine",
    "UnusualData": "model.unusual:UnusualData",
    "Verification": "verification:Verification",
    "WeakGrid": "smallsignal.weak_grid:WeakGrid",
    "cases": "io:packaged",
    "check": "model.unusual:check",
    "clearing_time": "clearing:clearing_time",
    "closed_loop": "smallsignal.closed_loop:closed_loop",
    "criteria": "judgment:criteria",
    "estimate": "estimation.estimate:estimate",
    "import_report": "io.import_report:import_report",
    "initialize": "dynamics.operating_point:initialize",
    "limit_cycles": "smallsignal.limit_cycles:limit_cycles",
    "linearize": "smallsignal:linearize",
    "load": "io:load",
    "load_controller": "io.control_files:load",
    "margins": "smallsignal.margins:margins",
    "modes": "smallsignal.analysis:modes",
    "place": "placement.place:place",
    "power_flow": "model.powerflow:solve",
    "read_contingencies": "io.contingencies:read_contingencies",
    "read_matpower": "io.matpower:read_matpower",
    "read_pst": "io.pst:read_pst",
    "read_psse": "io.psse:read_psse",
    "read_sweep": "sweep.results:read",
    "register": "devices:register",
    "replicate": "model.replicate:replicate",
    "run_sweep": "sweep.sweep:run_sweep",
    "screen": "clearing:screen",
    "short_circuit": "model.short_circuit:short_circuit",
    "short_circuit_ratio": "model.short_circuit:short_circuit_ratio",
    "simulate": "simulation.simulate:simulate",
    "study": "assessment:study",
    "verify": "verification:verify",
    "weak_grid": "smallsignal.weak_grid:weak_grid",
    "write": "io:write",
}  # name -> module:name

__all__ = [*_WHERE, "design"]


def __getattr__(name: str) -> object:
    if name == "design":
        return import_module("stabctl.design")
    if name == "__version__":
        return import_module("importlib.metadata").version("stabctl")
    if name not in _WHERE:
        raise AttributeError(f"module 'stabctl' has no attribute {name!r}")
    module, _, what = _WHERE[name].partition(":")
    found = globals()[name] = getattr(import_module(f"stabctl.{module}"), what)
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
